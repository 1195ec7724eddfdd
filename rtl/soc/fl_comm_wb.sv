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
    input sector_t zc_sector_i,
    input sector_t sector_i,     // sequencer's sector

    output logic   comm_valid_o,
    output stamp_t comm_sched_o,
    output logic   sched_valid_o,
    output logic   lost_o
);

  fl_comm_regs_pkg::fl_comm_regs__in_t hwif_in;
  fl_comm_regs_pkg::fl_comm_regs__out_t hwif_out;

  logic [5:0][23:0] sector_interval;

  for (genvar i = 0; i < 6; i++) begin : g_sector
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
      .zc_valid_i,
      .zc_time_i,
      .zc_late_i,
      .zc_sector_i,
      .sector_i,
      .comm_valid_o,
      .comm_sched_o,
      .sched_valid_o,
      .overdue_o             (),
      .lost_o,
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
