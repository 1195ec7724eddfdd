// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Control tick, update event and interval events with their registers.
`default_nettype none
module fl_timer_wb
  import fl_pkg::*;
  import fl_bus_pkg::*;
(
    input logic clk_i,
    input logic rst_i,

    input  bus_req_t        req_i,
    input  logic            stb_i,
    output logic     [31:0] rdat_o,

    input logic sync_i,

    output stamp_t now_o,
    output logic   tick_o,
    output logic   update_o,
    output logic   machine_o,
    output logic   load_o
);

  fl_timer_regs_pkg::fl_timer_regs__in_t  hwif_in;
  fl_timer_regs_pkg::fl_timer_regs__out_t hwif_out;

  fl_timer u_timer (
      .clk_i,
      .rst_i,
      .cfg_tick_period_i   (hwif_out.tick_period.cycles.value),
      .cfg_machine_period_i(hwif_out.machine_period.cycles.value),
      .cfg_load_period_i   (hwif_out.load_period.cycles.value),
      .cfg_tick_samples_i  (hwif_out.tick_samples.samples.value),
      .sync_i,
      .commit_i            (hwif_out.update.commit.value),
      .now_o,
      .tick_o,
      .update_o,
      .update_pending_o    (hwif_in.update.pending.next),
      .tick_count_o        (hwif_in.tick_count.count.next),
      .tick_time_o         (hwif_in.tick_time.stamp.next),
      .machine_o,
      .load_o
  );

  fl_timer_regs u_regs (
      .clk     (clk_i),
      .rst     (rst_i),
      .wb_cyc  (stb_i),
      .wb_stb  (stb_i),
      .wb_we   (req_i.we),
      .wb_stall(),
      .wb_adr  (req_i.adr[fl_timer_regs_pkg::FL_TIMER_REGS_MIN_ADDR_WIDTH-1:0]),
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
