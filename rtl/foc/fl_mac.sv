// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Multiplier with accumulators: one product a clock, a pipeline of operands, product and sum.
//
//   sum = init or accumulator +- x * c * (high ? 2^HighShift : 1)
//   sum = init or accumulator + c * c               with square_i; x is c without its lowest CBits - 18 bits
// Accumulators: one, and a pair that takes turns: a sum for the pair goes on from the last but one for the pair.
// x and c are operands of two clocks before, square of the clock before, everything else of the clock of the sum. c is
// wider than the multiplier of the device: its upper 18 bits go through it (18 x 18, one DSP), its lowest CBits - 18 bits
// are rows of an adder. They are 0 in a product that is shifted or subtracted (asserted).
// Signed integers, exact; the caller bounds the sums (asserted: no overflow).
// Latency: operands to the accumulator 3 clocks.
`default_nettype none
module fl_mac #(
    parameter int unsigned CBits     = 21,
    parameter int unsigned SumBits   = 49,
    parameter int unsigned HighShift = 10
) (
    input logic clk_i,
    input logic rst_i,

    input logic signed [     17:0] x_i,
    input logic signed [CBits-1:0] c_i,

    input logic square_i,

    input  logic                      enable_i,    // write an accumulator
    input  logic                      pair_i,      // of the pair
    input  logic                      first_i,     // from init_i
    input  logic signed [SumBits-1:0] init_i,
    input  logic                      subtract_i,
    input  logic                      high_i,
    output logic signed [SumBits-1:0] single_o,
    output logic signed [SumBits-1:0] pair_o       // the last sum for the pair
);

  localparam int unsigned LowBits = CBits - 18;
  localparam int unsigned RowBits = 18 + 1 + LowBits;  // 2^(LowBits+1) * x and the lowest bits of c
  localparam int unsigned ProductBits = 36;

  if (CBits <= 18 || CBits > 30 || SumBits < 18 + CBits + HighShift) begin : gen_illegal
    $fatal(1, "fl_mac: CBits 19 to 30, SumBits that hold a shifted product (%m)");
  end

  typedef logic signed [SumBits-1:0] sum_t;
  typedef logic signed [RowBits+LowBits-1:0] low_t;

  logic signed [17:0] x_q;
  logic signed [CBits-1:0] c_q;
  logic signed [RowBits-1:0] row;
  low_t [LowBits-1:0] rows;
  low_t low, low_q;
  logic signed [ProductBits-1:0] product;
  sum_t spread, high_q, base, term, sum;
  sum_t single_q, pair_q, other_q;  // other: the last but one for the pair

  // c = 2^LowBits x + l: c * c = 2^(2 LowBits) x * x + l (2^(LowBits+1) x + l).
  assign row = square_i ? {x_q, 1'b0, c_q[LowBits-1:0]} : RowBits'(x_q);

  always_comb begin
    low = '0;
    for (int unsigned i = 0; i < LowBits; i++) begin
      rows[i] = (low_t'(row) <<< i) & {$bits(low_t) {c_q[i]}};
      low += $signed(rows[i]);
    end
  end

  assign product = ProductBits'(x_q) * ProductBits'($signed(c_q[CBits-1:LowBits]));

  assign spread = square_i ? sum_t'(product) <<< 2 * LowBits : sum_t'(product) <<< LowBits;

  // -y = ~y + 1: low_q is 0 then, and its place takes the 1.
  assign base = first_i ? init_i : pair_i ? other_q : single_q;
  assign term = (high_i ? high_q <<< HighShift : high_q) ^ {SumBits{subtract_i}};
  assign sum  = base + term + (sum_t'(low_q) | sum_t'({1'b0, subtract_i}));

  always_ff @(posedge clk_i) begin
    x_q    <= x_i;
    c_q    <= c_i;
    high_q <= spread;
    low_q  <= low;
    if (enable_i && !pair_i) single_q <= sum;
    if (enable_i && pair_i) begin
      pair_q  <= sum;
      other_q <= pair_q;
    end
    if (!rst_i) begin
      assert (!(subtract_i || high_i) || low_q == '0)
      else $error("fl_mac: a product that is shifted or subtracted has a c with lowest bits");
    end
    if (!rst_i && enable_i) begin
      assert ((base[SumBits-1] != term[SumBits-1]) || sum[SumBits-1] == base[SumBits-1])
      else $error("fl_mac: sum overflows");
    end
  end

  assign single_o = single_q;
  assign pair_o   = pair_q;

endmodule
`default_nettype wire
