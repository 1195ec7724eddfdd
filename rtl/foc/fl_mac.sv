// Multiplier with accumulators: one product a clock, operands of one clock added in the next.
//
//   sum = (first ? init : accumulator[select]) +- x * c * (high ? 2^HighShift : 1)
// x and c are operands of the clock before, everything else of the clock of the sum. c is wider than the multiplier of
// the device: its upper 18 bits go through it (18 x 18, one DSP), its lowest CBits - 18 bits are rows of an adder.
// Signed integers, exact; the caller bounds the sums (asserted: no overflow).
// Latency: operands to sum_o 1 clock, to accumulator_o 2 clocks.
`default_nettype none
module fl_mac #(
    parameter int unsigned XBits        = 18,
    parameter int unsigned CBits        = 21,
    parameter int unsigned SumBits      = 50,
    parameter int unsigned HighShift    = 10,
    parameter int unsigned Accumulators = 3
) (
    input logic clk_i,
    input logic rst_i,

    input logic signed [XBits-1:0] x_i,
    input logic signed [CBits-1:0] c_i,

    input  logic                                                enable_i,      // write the accumulator
    input  logic        [$clog2(Accumulators)-1:0]              select_i,
    input  logic                                                first_i,
    input  logic signed [             SumBits-1:0]              init_i,
    input  logic                                                subtract_i,
    input  logic                                                high_i,
    output logic signed [             SumBits-1:0]              sum_o,
    output logic        [        Accumulators-1:0][SumBits-1:0] accumulator_o
);

  localparam int unsigned LowBits = CBits - 18;

  if (XBits > 18 || CBits <= 18 || Accumulators < 2 || SumBits < XBits + CBits + HighShift) begin : gen_illegal
    $fatal(1, "fl_mac: XBits to 18, CBits from 19, two Accumulators, SumBits that hold a shifted product (%m)");
  end

  logic signed [XBits+17:0] high_q;
  logic signed [XBits+LowBits-1:0] low, low_q;
  logic signed [XBits+CBits-1:0] product;
  logic signed [SumBits-1:0] shifted, term, base;
  logic [Accumulators-1:0][SumBits-1:0] accumulator_q;

  always_comb begin
    low = '0;
    for (int i = 0; i < LowBits; i++) begin
      if (c_i[i]) low += (XBits + LowBits)'(x_i) <<< i;
    end
  end

  assign product = ((XBits + CBits)'(high_q) <<< LowBits) + (XBits + CBits)'(low_q);
  assign shifted = high_i ? SumBits'(product) <<< HighShift : SumBits'(product);
  assign term    = subtract_i ? ~shifted : shifted;
  assign base    = first_i ? init_i : accumulator_q[select_i];
  assign sum_o   = base + term + SumBits'({1'b0, subtract_i});

  always_ff @(posedge clk_i) begin
    high_q <= (XBits + 18)'(x_i) * (XBits + 18)'($signed(c_i[CBits-1:LowBits]));
    low_q  <= low;
    if (enable_i) accumulator_q[select_i] <= sum_o;
    if (!rst_i && enable_i) begin
      assert (base[SumBits-1] != (shifted[SumBits-1] ^ subtract_i) || sum_o[SumBits-1] == base[SumBits-1])
      else $error("fl_mac: sum overflows");
    end
  end

  assign accumulator_o = accumulator_q;

endmodule
`default_nettype wire
