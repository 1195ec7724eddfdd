// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Proof of the receive side of the CAN controller for all inputs: a frame that a filter matches is kept or its loss is told,
// by pulse, count and the mark on the next entry; nothing is lost while there is room; entries come out as they went in.
`default_nettype none
module fl_can_rx_f
  import fl_can_pkg::*;
#(
    localparam int unsigned Depth   = 4,
    localparam int unsigned Filters = 2
) (
    input logic                      clk_i,
    input logic                      rst_i,
    input can_filter_t [Filters-1:0] filter_i,
    input logic                      valid_i,
    input can_frame_t                frame_i,
    input logic        [       31:0] stamp_i,
    input logic                      pop_i,
    input logic        [        1:0] place_i  // the entry that is followed
);

  logic valid_o, event_o, overrun_o;
  logic [7:0] lost_count_o;
  can_entry_t entry_o;

  fl_can_rx #(
      .Filters(Filters),
      .Depth  (Depth)
  ) dut (
      .*
  );

  function automatic logic fits(can_filter_t filter, can_frame_t frame);
    logic good;
    good = filter.enable;
    for (int unsigned i = 0; i < 29; i++) if (filter.mask[i] && filter.id[i] != frame.id[i]) good = 1'b0;
    if (filter.match_ext && frame.ext != filter.ext) good = 1'b0;
    if (filter.match_rtr && frame.rtr != filter.rtr) good = 1'b0;
    return good;
  endfunction

  logic first = 1'b1;
  logic kept_q;  // a filter matched in the last clock
  logic valid_q;
  can_frame_t frame_q;
  logic [31:0] stamp_q;
  logic [1:0] place_q;
  logic [2:0] level_q;  // entries
  logic [1:0] write_q, read_q;
  logic lost_q;  // since the last entry
  logic [7:0] count_q;
  can_entry_t followed_q;
  logic taken;

  assign taken = pop_i && level_q != '0;

  always_ff @(posedge clk_i) begin
    first   <= 1'b0;
    kept_q  <= valid_i && (fits(filter_i[0], frame_i) || fits(filter_i[1], frame_i));
    valid_q <= valid_i;
    frame_q <= frame_i;
    stamp_q <= stamp_i;
    place_q <= place_i;
    level_q <= level_q + 3'(event_o) - 3'(taken);
    write_q <= write_q + 2'(event_o);
    read_q  <= read_q + 2'(taken);
    if (event_o || overrun_o) lost_q <= overrun_o;
    if (event_o && write_q == place_i)
      followed_q <= '{lost: lost_q, filter: dut.filter_q, stamp: stamp_i, frame: frame_i};
    if (overrun_o && count_q != '1) count_q <= count_q + 8'd1;
    if (rst_i) begin
      kept_q  <= 1'b0;
      level_q <= '0;
      write_q <= '0;
      read_q  <= '0;
      lost_q  <= 1'b0;
      count_q <= '0;
    end
  end

  always_comb begin
    if (first)
      assume (rst_i);
      else begin
        assume (place_i == place_q);
        // The frame stays for a clock.
        assume (!valid_q || (frame_i == frame_q && stamp_i == stamp_q));
        // Verifies: CAN-19
        a_kept_or_told : assert ((event_o || overrun_o) == kept_q);
        a_not_both : assert (!(event_o && overrun_o));
        a_room : assert (overrun_o == (kept_q && level_q == 3'(Depth)));
        a_count : assert (lost_count_o == count_q);
        a_level : assert (level_q <= 3'(Depth) && valid_o == (level_q != '0));

        a_indices : assert (dut.u_fifo.write_q[1:0] == write_q && dut.u_fifo.read_q[1:0] == read_q);
        a_full : assert (dut.full == (level_q == 3'(Depth)));
        a_distance : assert (3'(dut.u_fifo.write_q - dut.u_fifo.read_q) == level_q);
        // Verifies: CAN-19
        a_lost : assert (dut.lost_q == lost_q);
        if ({1'b0, 2'(place_i - read_q)} < level_q) a_memory : assert (dut.u_fifo.g_distributed.mem[place_i] == followed_q);
        if (valid_o && read_q == place_i) a_entry : assert (entry_o == followed_q);
      end
  end

endmodule
`default_nettype wire
