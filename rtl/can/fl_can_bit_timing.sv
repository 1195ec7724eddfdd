// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// CAN bit timing (ISO 11898-1): time quanta, sample point, hard synchronisation, resynchronisation.
//
// A bit is 1 + (tseg1 + 1) + (tseg2 + 1) quanta of brp + 1 clocks: NBT. It is sampled at the end of the quantum tseg1 + 1.
// The bus is looked at once a quantum; an edge belongs to the quantum that ends with the look that finds it. An edge
// from recessive to dominant synchronises if the last sampled bit was recessive and none has since that sample:
//   hard_i at the bit's start, e > 0:  its quantum becomes the synchronisation segment
//   edge in quantum e <= tseg1 + 1, e > 0, unless a dominant bit is being sent:  the bit is min(e, sjw + 1) quanta longer
//   edge in quantum NBT - e, after the sample point:                            the bit is min(e, sjw + 1) quanta shorter
// A bit that an early edge ends begins with the quantum after the edge's, which counts as its second.
//
// sample_o: bit_o is the sampled level. start_o: tx_i is taken as the level of the bit that begins. From sample_o to
// the next start_o there is at least one clock, from sample_o to sample_o two. timing_i must not change while enable_i and
// in the clock before.
// enable_i low: no strobes, recessive. Latency: rx_i to bit_o, and to the strobes, 1 clock; start_o to tx_next_o 0, to
// tx_o 1 clock. The strobes come from flip-flops: what is decided in a clock acts in the next.
`default_nettype none
module fl_can_bit_timing
  import fl_can_pkg::*;
(
    input logic clk_i,
    input logic rst_i,
    input logic enable_i,

    input can_timing_t timing_i,

    input  logic rx_i,      // level of the bus, synchronous
    input  logic hard_i,    // the bit that begins belongs to the space between frames, its first bit excepted
    input  logic tx_i,      // level of the bit that begins
    output logic tx_next_o, // level sent from the next clock
    output logic tx_o,      // level being sent
    output logic start_o,
    output logic sample_o,
    output logic bit_o
);

  // Limits that the quantum is compared with, all side by side: a sum in front of a comparison would be two chains of
  // carries in the way from one quantum to the next, which with brp = 0 is one clock.
  logic [6:0] sample_quantum, last_quantum, jump;
  logic [6:0] sample_q, last_q, jump_q;
  logic [6:0] late_q;  // from here on an edge ends the bit: last quantum + 1 - jump, not below 0

  assign sample_quantum = {1'b0, timing_i.tseg1} + 7'd1;
  assign last_quantum   = sample_quantum + {3'd0, timing_i.tseg2} + 7'd1;
  assign jump           = {3'd0, timing_i.sjw} + 7'd1;

  always_ff @(posedge clk_i) begin
    sample_q <= sample_quantum;
    last_q   <= last_quantum;
    jump_q   <= jump;
    late_q   <= (last_q < jump_q) ? '0 : last_q - jump_q + 7'd1;
  end

  logic [7:0] clock_q;  // clocks to go in the quantum
  logic tick_q;         // none
  logic [6:0] quantum_d, quantum_q;  // of the bit, 0 is the synchronisation segment
  logic tick, after_sample_q, sync, start, sample;
  logic seen_q;   // level at the last look
  logic armed_q;  // the last sampled bit was recessive, no synchronisation since
  logic hard_q, tx_q;
  logic start_q, strobe_q, bit_q;

  assign tick = enable_i && tick_q;
  assign sync = seen_q && !rx_i && armed_q && quantum_q != '0;

  always_comb begin
    quantum_d = quantum_q + 7'd1;
    start     = 1'b0;
    sample    = 1'b0;
    if (sync && (hard_q || (after_sample_q && quantum_q >= late_q))) begin
      quantum_d = 7'd1;
      start     = 1'b1;
    end else if (sync && after_sample_q) begin
      // The jump does not reach the end of the bit, or just.
      start     = quantum_q + 7'd1 == late_q;
      quantum_d = start ? '0 : quantum_q + jump_q + 7'd1;
    end else if (sync && tx_q) begin
      quantum_d = (quantum_q <= jump_q) ? 7'd1 : quantum_q - jump_q + 7'd1;
    end else begin
      start  = quantum_q == last_q;
      sample = quantum_q == sample_q;
      if (start) quantum_d = '0;
    end
  end

  assign tx_next_o = start_o ? tx_i : tx_q;
  assign tx_o      = tx_q;
  assign start_o   = start_q && enable_i;
  assign sample_o  = strobe_q && enable_i;
  assign bit_o     = bit_q;

  always_ff @(posedge clk_i) begin
    clock_q  <= tick_q ? timing_i.brp : clock_q - 8'd1;
    tick_q   <= tick_q ? timing_i.brp == '0 : clock_q == 8'd1;
    start_q  <= tick && start;
    strobe_q <= tick && sample;
    bit_q    <= rx_i;
    if (tick) begin
      quantum_q <= quantum_d;
      seen_q    <= rx_i;
      if (start) after_sample_q <= 1'b0;
      else if (sample) after_sample_q <= 1'b1;
      // An edge in the synchronisation segment moves nothing and is the bit's only one.
      if (sample) armed_q <= rx_i;
      else if (seen_q && !rx_i) armed_q <= 1'b0;
    end
    if (start_o) begin
      hard_q <= hard_i;
      tx_q   <= tx_i;
    end
    if (rst_i || !enable_i) begin
      clock_q        <= timing_i.brp;
      tick_q         <= timing_i.brp == '0;
      quantum_q      <= '0;
      after_sample_q <= 1'b0;
      seen_q         <= 1'b1;
      armed_q        <= 1'b1;
      hard_q         <= 1'b1;
      tx_q           <= 1'b1;
      start_q        <= 1'b0;
      strobe_q       <= 1'b0;
    end
  end

endmodule
`default_nettype wire
