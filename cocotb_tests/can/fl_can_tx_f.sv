// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Proof of the transmit buffers of the CAN controller for all inputs: the frame on the bus stays; the highest priority is
// chosen; a waiting frame goes only as sent or as aborted, each told once, and aborted only if that was asked for.
`default_nettype none
module fl_can_tx_f
  import fl_can_pkg::*;
(
    input logic             clk_i,
    input logic             rst_i,
    input logic             enable_i,
    input logic       [2:0] put_i,
    input can_frame_t       put_frame_i,
    input logic       [1:0] put_priority_i,
    input logic       [2:0] abort_i,
    input logic             start_i,
    input logic             sent_i,
    input logic             stop_i
);

  logic [2:0] pending_o, sent_o, aborted_o, refused_o;
  logic request_o;
  can_frame_t frame_o;

  fl_can_tx dut (.*);

  logic first = 1'b1;
  logic busy_q, rst_q;  // busy_q: a frame is on the bus
  can_frame_t on_bus_q;
  can_frame_t [2:0] frame_q;
  logic [2:0][1:0] priority_q;
  logic [2:0] pending_q, asked_q, asked_before_q, put_q;
  logic sent_q;

  always_ff @(posedge clk_i) begin
    first          <= 1'b0;
    rst_q          <= rst_i;
    busy_q         <= enable_i && !stop_i && (start_i || (busy_q && !sent_i));
    sent_q         <= sent_i;
    pending_q      <= pending_o;
    put_q          <= put_i;
    asked_before_q <= asked_q | abort_i;
    asked_q        <= (asked_q | abort_i) & pending_o;
    for (int unsigned x = 0; x < 3; x++) begin
      if (put_i[x] && !pending_o[x]) begin
        frame_q[x]    <= put_frame_i;
        priority_q[x] <= put_priority_i;
        asked_q[x]    <= 1'b0;
      end
      if (start_i && dut.best[x]) on_bus_q <= frame_q[x];
    end
    if (rst_i) begin
      busy_q  <= 1'b0;
      asked_q <= '0;
    end
  end

  always_comb begin
    if (first)
      assume (rst_i);
      else begin
        assume (!start_i || (request_o && !busy_q && enable_i));
        assume (!sent_i || (busy_q && !stop_i));
        assert (busy_q == (dut.chosen_q != '0));
        assert ((dut.chosen_q & (dut.chosen_q - 3'd1)) == '0 && (dut.chosen_q & ~pending_o) == '0);
        assert ((dut.abort_q & ~pending_o) == '0 && dut.abort_q == (asked_q & pending_o));
        // Verifies: CAN-17
        a_stays : assert (!busy_q || frame_o == on_bus_q);
        // Verifies: CAN-16
        a_request : assert (request_o == ((pending_o & ~dut.abort_q) != '0));
        // Verifies: CAN-17
        if (!rst_q) a_sent : assert ((sent_o != '0) == sent_q);
        // Verifies: CAN-16
        a_chosen : assert ((dut.best != '0) == request_o);
      end
  end

  for (genvar x = 0; x < 3; x++) begin : g_buffer
    logic highest;
    always_comb begin
      highest = 1'b1;
      for (int unsigned y = 0; y < 3; y++) begin
        if (pending_o[y] && !asked_q[y] && (priority_q[y] > priority_q[x] || (priority_q[y] == priority_q[x] && y < x))) highest = 1'b0;
      end
      if (!first) begin
        if (pending_o[x]) assert (dut.frame_q[x] == frame_q[x] && dut.priority_q[x] == priority_q[x]);
        // Verifies: CAN-16
        a_best : assert (dut.best[x] == (pending_o[x] && !asked_q[x] && highest));
        if (!rst_q) begin
          // Verifies: CAN-17
          a_told : assert ((sent_o[x] ^ aborted_o[x]) == (pending_q[x] && !pending_o[x]));
          a_once : assert (!(sent_o[x] && aborted_o[x]));
          a_asked : assert (!aborted_o[x] || asked_before_q[x]);

          a_refused : assert (refused_o[x] == (put_q[x] && pending_q[x]));
        end
      end
    end
  end

endmodule
`default_nettype wire
