// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Hall sensors with their registers.
`default_nettype none
module fl_hall_wb
  import fl_pkg::*;
  import fl_bus_pkg::*;
(
    input logic clk_i,
    input logic rst_i,

    input  bus_req_t        req_i,
    input  logic            stb_i,
    output logic     [31:0] rdat_o,

    input stamp_t       now_i,
    input logic   [2:0] hall_i,      // asynchronous
    input logic         update_i,
    input logic         reverse_i,   // staged setting
    input logic         zc_valid_i,
    input stamp_t       zc_time_i,

    output logic    valid_o,     // an edge
    output stamp_t  time_o,
    output sector_t position_o,
    output logic    backward_o,
    output logic    single_o,
    output logic    ok_o,
    output logic    event_o      // an edge or an invalid code
);

  fl_hall_regs_pkg::fl_hall_regs__in_t  hwif_in;
  fl_hall_regs_pkg::fl_hall_regs__out_t hwif_out;

  logic reverse_q, invalid_event;
  logic [7:0][ 2:0] map;
  logic [5:0][23:0] phase;

  assign map = {
    hwif_out.map.code7.value,
    hwif_out.map.code6.value,
    hwif_out.map.code5.value,
    hwif_out.map.code4.value,
    hwif_out.map.code3.value,
    hwif_out.map.code2.value,
    hwif_out.map.code1.value,
    hwif_out.map.code0.value
  };

  for (genvar i = 0; i < 6; i++) begin : g_phase
    assign hwif_in.phase[i].cycles.next = phase[i];
  end

  always_ff @(posedge clk_i) begin
    if (update_i) reverse_q <= reverse_i;
    if (rst_i) reverse_q <= 1'b0;
  end

  assign hwif_in.state.valid.next     = ok_o;
  assign hwif_in.state.backward.next  = backward_o;
  assign hwif_in.edge_time.stamp.next = time_o;
  assign event_o                      = valid_o || invalid_event;

  fl_hall u_hall (
      .clk_i,
      .rst_i,
      .now_i,
      .hall_i,
      .cfg_filter_i   (hwif_out.filter.cycles.value),
      .cfg_map_i      (map),
      .reverse_i      (reverse_q),
      .zc_valid_i,
      .zc_time_i,
      .valid_o,
      .invalid_event_o(invalid_event),
      .time_o,
      .position_o,
      .sector_o       (hwif_in.state.sector.next),
      .backward_o,
      .single_o,
      .ok_o,
      .moved_o        (hwif_in.state.moved.next),
      .code_o         (hwif_in.state.code.next),
      .raw_o          (hwif_in.state.raw.next),
      .edges_o        (hwif_in.counters.edges.next),
      .invalid_o      (hwif_in.counters.invalid.next),
      .skipped_o      (hwif_in.counters.skipped.next),
      .phase_o        (phase)
  );

  fl_hall_regs u_regs (
      .clk     (clk_i),
      .rst     (rst_i),
      .wb_cyc  (stb_i),
      .wb_stb  (stb_i),
      .wb_we   (req_i.we),
      .wb_stall(),
      .wb_adr  (req_i.adr[fl_hall_regs_pkg::FL_HALL_REGS_MIN_ADDR_WIDTH-1:0]),
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
