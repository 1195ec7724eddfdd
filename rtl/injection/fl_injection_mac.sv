// The multiplier that the injection blocks share: a request is operands and what becomes of their product.
//
//   sum = (first ? 2^half : accumulator) + x c (high ? 2^FineShift : 1)
// Signed integers, exact; x 18 bits, c 25 bits; the caller bounds the sums (asserted in fl_mac).
// Latency: request_i to sum_o Latency clocks, a request every clock. A sum is there for its clock only, its accumulator
// for the next request to it.
`default_nettype none
module fl_injection_mac
  import fl_injection_pkg::*;
#(
    // verilator lint_off UNUSEDPARAM
    localparam int unsigned Latency = 2
    // verilator lint_on UNUSEDPARAM
) (
    input  logic clk_i,
    input  logic rst_i,
    input  mac_t request_i,
    output sum_t sum_o
);

  mac_t [1:0] request_q;

  always_ff @(posedge clk_i) begin
    request_q <= {request_q[0], request_i};
    if (rst_i) request_q <= '0;
  end

  fl_mac #(
      .CBits       (25),
      .SumBits     (SumBits),
      .HighShift   (FineShift),
      .Accumulators(2)
  ) u_mac (
      .clk_i,
      .rst_i,
      .x_i          (request_q[0].x),
      .c_i          (request_q[0].c),
      .enable_i     (request_q[1].enable),
      .select_i     (request_q[1].accumulator),
      .first_i      (request_q[1].first),
      .init_i       (sum_t'(1) << request_q[1].half),
      .subtract_i   (1'b0),
      .high_i       (request_q[1].high),
      .sum_o,
      .accumulator_o()
  );

  // The operands of the second stage are in the product.
  logic unused;
  assign unused = &{1'b0, request_q[1].x, request_q[1].c};

endmodule
`default_nettype wire
