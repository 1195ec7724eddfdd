// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Incremental encoder with its registers.
`default_nettype none
module fl_encoder_wb
  import fl_bus_pkg::*;
(
    input logic clk_i,
    input logic rst_i,

    input  bus_req_t        req_i,
    input  logic            stb_i,
    output logic     [31:0] rdat_o,

    input  logic [ 2:0] encoder_i,   // Z, B, A, asynchronous
    output logic [17:0] position_o,  // quarters
    output logic        indexed_o
);

  fl_encoder_regs_pkg::fl_encoder_regs__in_t  hwif_in;
  fl_encoder_regs_pkg::fl_encoder_regs__out_t hwif_out;

  assign hwif_in.state.position.next = position_o;
  assign hwif_in.state.indexed.next  = indexed_o;

  fl_encoder u_encoder (
      .clk_i,
      .rst_i,
      .encoder_i,
      .cfg_filter_i(hwif_out.filter.cycles.value),
      .cfg_last_i  (hwif_out.turn.last.value),
      .cfg_index_i (hwif_out.turn.index.value),
      .position_o,
      .indexed_o,
      .backward_o  (hwif_in.state.backward.next),
      .raw_o       (hwif_in.state.raw.next),
      .level_o     (hwif_in.state.filtered.next),
      .invalid_o   (hwif_in.counters.invalid.next),
      .strayed_o   (hwif_in.counters.strayed.next)
  );

  fl_encoder_regs u_regs (
      .clk     (clk_i),
      .rst     (rst_i),
      .wb_cyc  (stb_i),
      .wb_stb  (stb_i),
      .wb_we   (req_i.we),
      .wb_stall(),
      .wb_adr  (req_i.adr[fl_encoder_regs_pkg::FL_ENCODER_REGS_MIN_ADDR_WIDTH-1:0]),
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
