// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Commutation timer with its registers.
`default_nettype none
module fl_comm_wb
  import fl_pkg::*;
  import fl_bus_pkg::*;
(
    input logic clk_i,
    input logic rst_i,

    input  bus_req_t        req_i,
    input  logic            stb_i,
    output logic     [31:0] rdat_o,

    input stamp_t now_i,
    input logic   tick_i,
    input logic   update_i,

    input logic    zc_valid_i,
    input stamp_t  zc_time_i,
    input logic    zc_late_i,
    input logic    zc_back_i,
    input sector_t zc_sector_i,
    input sector_t sector_i,     // sequencer's sector
    input logic    reverse_i,    // staged setting

    input logic    hall_valid_i,
    input stamp_t  hall_time_i,
    input sector_t hall_position_i,
    input logic    hall_backward_i,
    input logic    hall_single_i,
    input logic    hall_ok_i,

    output logic    comm_valid_o,
    output stamp_t  comm_sched_o,
    output logic    comm_load_o,
    output sector_t comm_sector_o,
    output logic    sched_valid_o,
    output logic    lost_o,

    output logic [23:0] interval_o,
    output logic [23:0] mean_o,
    output logic        known_o
);

  fl_comm_regs_pkg::fl_comm_regs__in_t hwif_in;
  fl_comm_regs_pkg::fl_comm_regs__out_t hwif_out;

  logic [5:0][23:0] sector_interval;
  logic [5:0][15:0] hall_offset;

  for (genvar i = 0; i < 6; i++) begin : g_sector
    assign hall_offset[i] = hwif_out.hall_offset[i].interval_q16.value;
    assign hwif_in.snap_sector_interval[i].cycles.next = sector_interval[i];
  end

  fl_commutation_timer u_timer (
      .clk_i,
      .rst_i,
      .now_i,
      .update_i,
      .tick_i,
      .cfg_mode_i            (comm_mode_e'(hwif_out.control.mode.value)),
      .cfg_force_on_miss_i   (hwif_out.control.force_on_miss.value),
      .cfg_miss_limit_i      (hwif_out.control.miss_limit.value),
      .cfg_delay_q16_i       (hwif_out.delay.interval_q16.value),
      .cfg_advance_q16_i     (hwif_out.delay.advance_q16.value),
      .cfg_latency_i         (hwif_out.latency.cycles.value),
      .cfg_forced_interval_i (hwif_out.forced_interval.cycles.value),
      .cfg_timeout_q12_i     (hwif_out.timeout.interval_q12.value),
      .cfg_correction_a_i    (hwif_out.control.correction_a.value),
      .cfg_hall_timed_i      (hwif_out.control.hall_timed.value),
      .cfg_hall_offset_q16_i (hall_offset),
      .cfg_reverse_i         (reverse_i),
      .zc_valid_i,
      .zc_time_i,
      .zc_late_i,
      .zc_back_i,
      .zc_sector_i,
      .sector_i,
      .hall_valid_i,
      .hall_time_i,
      .hall_position_i,
      .hall_backward_i,
      .hall_single_i,
      .hall_ok_i,
      .comm_valid_o,
      .comm_sched_o,
      .comm_load_o,
      .comm_sector_o,
      .sched_valid_o,
      .overdue_o             (),
      .lost_o,
      .interval_o,
      .mean_o,
      .known_o,
      .snap_mean_o           (hwif_in.snap_delay.mean.next),
      .snap_known_o          (hwif_in.snap_delay.known.next),
      .snap_corrected_o      (hwif_in.snap_delay.corrected.next),
      .snap_interval_o       (hwif_in.snap_interval.cycles.next),
      .snap_period_o         (hwif_in.snap_period.cycles.next),
      .snap_zc_time_o        (hwif_in.snap_zc_time.stamp.next),
      .snap_crossings_o      (hwif_in.snap_counters.crossings.next),
      .snap_misses_o         (hwif_in.snap_counters.misses.next),
      .snap_late_o           (hwif_in.snap_counters.late.next),
      .snap_commutations_o   (hwif_in.snap_events.commutations.next),
      .snap_overdue_o        (hwif_in.snap_events.overdue.next),
      .snap_timeouts_o       (hwif_in.snap_events.timeouts.next),
      .snap_sector_interval_o(sector_interval)
  );

  fl_comm_regs u_regs (
      .clk     (clk_i),
      .rst     (rst_i),
      .wb_cyc  (stb_i),
      .wb_stb  (stb_i),
      .wb_we   (req_i.we),
      .wb_stall(),
      .wb_adr  (req_i.adr[fl_comm_regs_pkg::FL_COMM_REGS_MIN_ADDR_WIDTH-1:0]),
      .wb_odat (req_i.wdat),
      .wb_sel  (req_i.sel),
      .wb_ack  (),
      .wb_err  (),
      .wb_idat (rdat_o),
      .hwif_in,
      .hwif_out
  );

endmodule
`default_nettype wire
