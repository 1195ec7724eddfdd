// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// For the proofs of equality: flip-flops that an input clears without a clock.
`default_nettype none
module fl_cleared (
    input  logic clk_i,
    input  logic clear_i,
    input  logic level_i,
    output logic level_o
);

  logic [1:0] stage_q;
  always_ff @(posedge clk_i or posedge clear_i) begin
    if (clear_i) stage_q <= '0;
    else stage_q <= {stage_q[0], level_i};
  end

  // The clear is in the flip-flop already.
  assign level_o = stage_q[1] && !clear_i;

endmodule
`default_nettype wire
