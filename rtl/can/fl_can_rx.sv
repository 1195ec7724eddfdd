// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Receive side of the CAN controller: acceptance filters, FIFO with time stamps.
//
// A frame that an enabled filter matches is kept; without an enabled filter none is. A frame that finds the FIFO full is
// lost: overrun_o pulses, lost_count_o counts (saturates), and the next frame that is kept has its lost bit set.
// frame_i and stamp_i must stay for one clock after valid_i. Latency: valid_i to event_o or overrun_o 1 clock, to
// valid_o 2 clocks. The oldest entry is at entry_o while valid_o; pop_i takes it.
`default_nettype none
module fl_can_rx
  import fl_can_pkg::*;
#(
    parameter int unsigned Filters = 8,
    parameter int unsigned Depth   = 32
) (
    input logic clk_i,
    input logic rst_i,

    input can_filter_t [Filters-1:0] filter_i,

    input logic              valid_i,
    input can_frame_t        frame_i,
    input logic       [31:0] stamp_i,

    input  logic       pop_i,
    output logic       valid_o,
    output can_entry_t entry_o,

    output logic       event_o,
    output logic       overrun_o,
    output logic [7:0] lost_count_o
);

  if (Filters < 1 || Filters > 8) begin : g_check
    $fatal(1, "fl_can_rx: 1 to 8 filters (%m)");
  end

  logic hit_d, hit_q, full, lost_q;
  logic [2:0] filter_d, filter_q;
  logic [7:0] lost_count_q;
  can_entry_t entry;

  always_comb begin
    hit_d    = 1'b0;
    filter_d = '0;
    for (int unsigned x = Filters; x > 0; x--) begin
      if (filter_i[x-1].enable && ((frame_i.id ^ filter_i[x-1].id) & filter_i[x-1].mask) == '0 &&
          !(filter_i[x-1].match_ext && filter_i[x-1].ext != frame_i.ext) &&
          !(filter_i[x-1].match_rtr && filter_i[x-1].rtr != frame_i.rtr)) begin
        hit_d    = valid_i;
        filter_d = 3'(x - 1);
      end
    end
  end

  assign entry     = '{lost: lost_q, filter: filter_q, stamp: stamp_i, frame: frame_i};
  assign event_o   = hit_q && !full;
  assign overrun_o = hit_q && full;

  fl_fifo #(
      .Width($bits(can_entry_t)),
      .Depth(Depth)
  ) u_fifo (
      .clk_i,
      .rst_i,
      .push_i (event_o),
      .data_i (entry),
      .full_o (full),
      .pop_i,
      .data_o (entry_o),
      .valid_o
  );

  always_ff @(posedge clk_i) begin
    hit_q    <= hit_d;
    filter_q <= filter_d;
    if (hit_q) lost_q <= full;
    if (overrun_o && lost_count_q != '1) lost_count_q <= lost_count_q + 8'd1;
    if (rst_i) begin
      hit_q        <= 1'b0;
      filter_q     <= '0;
      lost_q       <= 1'b0;
      lost_count_q <= '0;
    end
  end

  assign lost_count_o = lost_count_q;

endmodule
`default_nettype wire
