// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// The multiplier that the injection blocks share: a request is operands and what becomes of their product.
//
//   sum = (first ? 2^half : accumulator) + x c (high ? 2^FineShift : 1)
// Signed integers, exact; x 18 bits, c 25 bits: 25 x 18 takes two multipliers of 18 x 18, for c's upper 18 bits and its
// lower 7. The caller bounds the sums (asserted: no overflow).
// Latency: request_i to sum_o Latency clocks, a request every clock. A sum is there for its clock only, its accumulator
// for the next request to it.
`default_nettype none
module fl_injection_mac
  import fl_injection_pkg::*;
#(
    localparam int unsigned Latency = 3
) (
    input  logic clk_i,
    input  logic rst_i,
    input  mac_t request_i,
    output sum_t sum_o
);

  localparam int unsigned LowBits = 7;

  mac_t [1:0] request_q;
  logic signed [35:0] high_q;
  logic signed [25:0] low_q;
  logic signed [42:0] product;
  sum_t shifted, base, sum, sum_q;
  sum_t [1:0] accumulator_q;

  assign product = (43'(high_q) <<< LowBits) + 43'(low_q);
  assign shifted = request_q[1].high ? sum_t'(product) <<< FineShift : sum_t'(product);
  assign base = request_q[1].first ? sum_t'(1) << request_q[1].half : accumulator_q[request_q[1].accumulator];
  assign sum = base + shifted;
  assign sum_o = sum_q;

  always_ff @(posedge clk_i) begin
    request_q <= {request_q[0], request_i};
    high_q    <= 36'($signed(request_q[0].x)) * 36'($signed(request_q[0].c[24:LowBits]));
    low_q     <= 26'($signed(request_q[0].x)) * 26'($signed({1'b0, request_q[0].c[LowBits-1:0]}));
    if (request_q[1].enable) accumulator_q[request_q[1].accumulator] <= sum;
    sum_q <= sum;
    if (!rst_i && request_q[1].enable) begin
      assert (base[SumBits-1] != shifted[SumBits-1] || sum[SumBits-1] == base[SumBits-1])
      else $error("fl_injection_mac: sum overflows");
    end
    if (rst_i) request_q <= '0;
  end

  // The operands of the second stage are in the product.
  logic unused;
  assign unused = &{1'b0, request_q[1].x, request_q[1].c};

endmodule
`default_nettype wire
