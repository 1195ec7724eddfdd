// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Freewheel measurement with its registers.
`default_nettype none
module fl_freewheel_wb
  import fl_pkg::*;
  import fl_bus_pkg::*;
#(
    parameter  int unsigned Phases   = 3,
    localparam int unsigned Channels = 2 * Phases + 3
) (
    input logic clk_i,
    input logic rst_i,

    input  bus_req_t        req_i,
    input  logic            stb_i,
    output logic     [31:0] rdat_o,

    input stamp_t now_i,
    input logic   tick_i,
    input logic   update_i,

    input logic    comm_applied_i,
    input sector_t sector_i,

    input logic                   sample_valid_i,
    input sample_t [Channels-1:0] sample_i,
    input stamp_t                 sample_time_i,
    input sector_t                sample_sector_i
);

  fl_freewheel_regs_pkg::fl_freewheel_regs__in_t  hwif_in;
  fl_freewheel_regs_pkg::fl_freewheel_regs__out_t hwif_out;

  fl_freewheel #(
      .Phases(Phases)
  ) u_freewheel (
      .clk_i,
      .rst_i,
      .now_i,
      .update_i,
      .cfg_enable_i     (hwif_out.control.enable.value),
      .cfg_limit_i      (hwif_out.threshold.limit.value),
      .comm_applied_i,
      .sector_i,
      .sample_valid_i,
      .sample_i,
      .sample_time_i,
      .sample_sector_i,
      .done_o           (),
      .last_cycles_o    (hwif_in.last.cycles.next),
      .last_sector_o    (hwif_in.last.sector.next),
      .last_open_o      (hwif_in.last.open.next),
      .tick_i,
      .snap_sum_o       (hwif_in.snap_sum.cycles.next),
      .snap_max_o       (hwif_in.snap_max.cycles.next),
      .snap_max_sector_o(hwif_in.snap_max.sector.next),
      .snap_count_o     (hwif_in.snap_count.count.next),
      .snap_open_o      (hwif_in.snap_count.open.next)
  );

  fl_freewheel_regs u_regs (
      .clk     (clk_i),
      .rst     (rst_i),
      .wb_cyc  (stb_i),
      .wb_stb  (stb_i),
      .wb_we   (req_i.we),
      .wb_stall(),
      .wb_adr  (req_i.adr[fl_freewheel_regs_pkg::FL_FREEWHEEL_REGS_MIN_ADDR_WIDTH-1:0]),
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
