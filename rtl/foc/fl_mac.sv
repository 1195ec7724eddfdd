// Multiplier with accumulators: one product a clock, a pipeline of operands, product and sum.
//
//   sum = (first ? init : accumulator[select]) +- x * c * (high ? 2^HighShift : 1)
//   sum = (first ? init : accumulator[select]) + c * c                      with square_i; x is c without its lowest bits
// x and c are operands of two clocks before, square, high and subtract of the clock before, everything else of the clock
// of the sum. c is wider than the multiplier of the device: its upper 18 bits go through it (18 x 18, one DSP), its lowest
// CBits - 18 bits are rows of an adder. They are 0 in a product that is shifted or subtracted (asserted).
// Signed integers, exact; the caller bounds the sums (asserted: no overflow).
// Latency: operands to sum_o 2 clocks, to accumulator_o 3 clocks.
`default_nettype none
module fl_mac #(
    parameter int unsigned CBits        = 21,
    parameter int unsigned SumBits      = 49,
    parameter int unsigned HighShift    = 10,
    parameter int unsigned Accumulators = 3
) (
    input logic clk_i,
    input logic rst_i,

    input logic signed [     17:0] x_i,
    input logic signed [CBits-1:0] c_i,

    input logic square_i,
    input logic subtract_i,
    input logic high_i,

    input  logic        [        Accumulators-1:0]              write_i,       // the accumulator, one or none
    input  logic        [$clog2(Accumulators)-1:0]              select_i,
    input  logic                                                first_i,
    input  logic signed [             SumBits-1:0]              init_i,
    output logic        [        Accumulators-1:0][SumBits-1:0] accumulator_o
);

  localparam int unsigned LowBits = CBits - 18;
  localparam int unsigned RowBits = 18 + 1 + LowBits;  // 2^(LowBits+1) * x and the lowest bits of c
  localparam int unsigned ProductBits = 36;

  if (CBits <= 18 || CBits > 30 || Accumulators < 2 || SumBits < 18 + CBits + HighShift) begin : gen_illegal
    $fatal(1, "fl_mac: CBits 19 to 30, two Accumulators, SumBits that hold a shifted product (%m)");
  end

  typedef logic signed [SumBits-1:0] sum_t;
  typedef logic signed [RowBits+LowBits-1:0] low_t;

  logic signed [17:0] x_q;
  logic signed [CBits-1:0] c_q;
  logic signed [RowBits-1:0] row;
  low_t low, low_q;
  logic signed [ProductBits-1:0] product;
  sum_t spread, high_q, base, sum;
  logic [Accumulators-1:0][SumBits-1:0] accumulator_q;

  // c = 2^LowBits x + l: c * c = 2^(2 LowBits) x * x + l (2^(LowBits+1) x + l).
  assign row = square_i ? {x_q, 1'b0, c_q[LowBits-1:0]} : RowBits'(x_q);

  always_comb begin
    low = '0;
    for (int i = 0; i < LowBits; i++) begin
      if (c_q[i]) low += low_t'(row) <<< i;
    end
  end

  assign product = ProductBits'(x_q) * ProductBits'($signed(c_q[CBits-1:LowBits]));

  always_comb begin
    if (square_i) spread = sum_t'(product) <<< 2 * LowBits;
    else if (high_i) spread = sum_t'(product) <<< LowBits + HighShift;
    else spread = sum_t'(product) <<< LowBits;
  end

  assign base = first_i ? init_i : accumulator_q[select_i];
  assign sum  = base + high_q + sum_t'(low_q);

  always_ff @(posedge clk_i) begin
    x_q    <= x_i;
    c_q    <= c_i;
    // -y = ~y + 1
    high_q <= subtract_i ? ~spread : spread;
    low_q  <= subtract_i ? low_t'(1) : low;
    for (int unsigned a = 0; a < Accumulators; a++) if (write_i[a]) accumulator_q[a] <= sum;
  end

  assign accumulator_o = accumulator_q;

  logic narrow_q;
  always_ff @(posedge clk_i) begin
    narrow_q <= !(subtract_i || high_i) || low == '0;
    if (!rst_i && write_i != '0) begin
      assert (narrow_q)
      else $error("fl_mac: a product that is shifted or subtracted has a c with lowest bits");
      assert (sum_t'(high_q + sum_t'(low_q)) >>> (SumBits - 1) != base >>> (SumBits - 1) ||
              sum[SumBits-1] == base[SumBits-1])
      else $error("fl_mac: sum overflows");
    end
  end

endmodule
`default_nettype wire
