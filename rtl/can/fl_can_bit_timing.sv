// CAN bit timing (ISO 11898-1): time quanta, sample point, hard synchronisation, resynchronisation.
//
// A bit is 1 + (tseg1 + 1) + (tseg2 + 1) quanta of brp + 1 clocks: NBT. It is sampled at the end of the quantum tseg1 + 1.
// The bus is looked at once a quantum; an edge belongs to the quantum that ends with the look that finds it. An edge
// from recessive to dominant synchronises if the last sampled bit was recessive and none has since that sample:
//   hard_i at the bit's start:  its quantum becomes the synchronisation segment
//   edge in quantum e <= tseg1 + 1, e > 0, unless a dominant bit is being sent:  the bit is min(e, sjw + 1) quanta longer
//   edge in quantum NBT - e, after the sample point:                            the bit is min(e, sjw + 1) quanta shorter
// A bit that an early edge ends begins with the quantum after the edge's, which counts as its second.
//
// sample_o: bit_o is the sampled level. start_o: tx_i is taken as the level of the bit that begins. From sample_o to
// the next start_o there is at least one clock. timing_i must not change while enable_i.
// enable_i low: no strobes, recessive. Latency: rx_i to bit_o 0; start_o to tx_o 1 clock.
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
    output logic tx_o,      // level being sent
    output logic start_o,
    output logic sample_o,
    output logic bit_o
);

  logic [7:0] clock_q;  // of the quantum
  logic [6:0] quantum_d, quantum_q;  // of the bit, 0 is the synchronisation segment
  logic [6:0] sample_quantum, last_quantum, jump, early;
  logic tick, after_sample, sync, longer;
  logic seen_q;   // level at the last look
  logic armed_q;  // the last sampled bit was recessive, no synchronisation since
  logic hard_q, tx_q;

  assign sample_quantum = {1'b0, timing_i.tseg1} + 7'd1;
  assign last_quantum   = sample_quantum + {3'd0, timing_i.tseg2} + 7'd1;
  assign jump           = {3'd0, timing_i.sjw} + 7'd1;

  assign tick         = enable_i && clock_q == timing_i.brp;
  assign after_sample = quantum_q > sample_quantum;
  assign early        = last_quantum - quantum_q + 7'd1;
  assign longer       = !hard_q && !after_sample && tx_q && quantum_q != '0;
  assign sync         = tick && seen_q && !rx_i && armed_q;

  always_comb begin
    quantum_d = quantum_q + 7'd1;
    start_o   = 1'b0;
    sample_o  = 1'b0;
    if (sync && (hard_q || (after_sample && early <= jump))) begin
      quantum_d = 7'd1;
      start_o   = 1'b1;
    end else if (sync && longer) begin
      quantum_d = (quantum_q <= jump) ? 7'd1 : quantum_q - jump + 7'd1;
    end else begin
      if (sync && after_sample) quantum_d = quantum_q + jump + 7'd1;
      if (quantum_d > last_quantum) quantum_d = '0;
      start_o  = tick && quantum_d == '0;
      sample_o = tick && quantum_q == sample_quantum;
    end
  end

  assign bit_o = rx_i;
  assign tx_o  = tx_q;

  always_ff @(posedge clk_i) begin
    clock_q <= tick ? '0 : clock_q + 8'd1;
    if (tick) begin
      quantum_q <= quantum_d;
      seen_q    <= rx_i;
    end
    if (sample_o) armed_q <= rx_i;
    else if (sync) armed_q <= 1'b0;
    if (start_o) begin
      hard_q <= hard_i;
      tx_q   <= tx_i;
    end
    if (rst_i || !enable_i) begin
      clock_q   <= '0;
      quantum_q <= '0;
      seen_q    <= 1'b1;
      armed_q   <= 1'b1;
      hard_q    <= 1'b1;
      tx_q      <= 1'b1;
    end
  end

endmodule
`default_nettype wire
