// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Transmit buffers of the CAN controller: the waiting frame of the highest priority goes first, the lower number among
// equals, chosen anew for every start of frame.
//
// put_i: frame and priority into a buffer, which waits from the next clock; refused if it is waiting already.
// abort_i: a waiting buffer is not chosen from the next clock and given up in it; one whose frame is on the bus when that ends
// without success.
// frame_o is there from the clock after start_i to sent_i, stop_i or enable_i low. sent_o, refused_o: pulses, latency 1 clock;
// aborted_o 2 clocks.
`default_nettype none
module fl_can_tx
  import fl_can_pkg::*;
#(
    parameter int unsigned Buffers = 3
) (
    input logic clk_i,
    input logic rst_i,
    input logic enable_i,

    input  logic       [Buffers-1:0] put_i,
    input  can_frame_t               put_frame_i,
    input  logic       [        1:0] put_priority_i,  // 3 is the highest
    input  logic       [Buffers-1:0] abort_i,
    output logic       [Buffers-1:0] pending_o,
    output logic       [Buffers-1:0] sent_o,
    output logic       [Buffers-1:0] aborted_o,
    output logic       [Buffers-1:0] refused_o,

    output logic       request_o,
    output can_frame_t frame_o,
    input  logic       start_i,
    input  logic       sent_i,
    input  logic       stop_i
);

  if (Buffers < 2) begin : g_check
    $fatal(1, "fl_can_tx: at least two buffers (%m)");
  end

  can_frame_t [Buffers-1:0] frame_q;
  logic [Buffers-1:0][1:0] priority_q;
  logic [Buffers-1:0] pending_q, abort_q;  // abort_q: unless it is on the bus
  logic [Buffers-1:0] waiting, best, chosen_q;  // one bit at most
  logic [Buffers-1:0] sent_q, aborted_q, refused_q;

  assign waiting = pending_q & ~abort_q;

  always_comb begin
    best = '0;
    for (int unsigned level = 0; level < 4; level++) begin
      for (int unsigned x = Buffers; x > 0; x--) begin
        if (waiting[x-1] && priority_q[x-1] == 2'(level)) begin
          best      = '0;
          best[x-1] = 1'b1;
        end
      end
    end
  end

  assign request_o = waiting != '0;

  always_comb begin
    frame_o = '0;
    for (int unsigned x = 0; x < Buffers; x++) begin
      if (chosen_q[x]) frame_o |= frame_q[x];
    end
  end

  always_ff @(posedge clk_i) begin
    if (sent_i || stop_i || !enable_i) chosen_q <= '0;
    else if (start_i && chosen_q == '0) chosen_q <= best;
    sent_q    <= '0;
    aborted_q <= '0;
    refused_q <= put_i & pending_q;
    for (int unsigned x = 0; x < Buffers; x++) begin
      if (put_i[x] && !pending_q[x]) begin
        frame_q[x]    <= put_frame_i;
        priority_q[x] <= put_priority_i;
        pending_q[x]  <= 1'b1;
      end
      if (chosen_q[x] && sent_i) begin
        pending_q[x] <= 1'b0;
        abort_q[x]   <= 1'b0;
        sent_q[x]    <= 1'b1;
      end else if (abort_q[x] && (!chosen_q[x] || stop_i || !enable_i)) begin
        pending_q[x] <= 1'b0;
        abort_q[x]   <= 1'b0;
        aborted_q[x] <= 1'b1;
      end else if (pending_q[x] && abort_i[x]) abort_q[x] <= 1'b1;
    end
    if (rst_i) begin
      chosen_q   <= '0;
      pending_q  <= '0;
      abort_q    <= '0;
      priority_q <= '0;
      sent_q     <= '0;
      aborted_q  <= '0;
      refused_q  <= '0;
    end
  end

  assign pending_o = pending_q;
  assign sent_o    = sent_q;
  assign aborted_o = aborted_q;
  assign refused_o = refused_q;

endmodule
`default_nettype wire
