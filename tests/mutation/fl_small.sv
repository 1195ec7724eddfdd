// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Block of the machinery's own test: y_o is a_i one clock later. The term with b_i changes nothing.
`default_nettype none
module fl_small (
    input  logic clk_i,
    input  logic rst_i,
    input  logic a_i,
    input  logic b_i,
    output logic y_o
);
  logic y_q;
  always_ff @(posedge clk_i) begin
    y_q <= a_i & (a_i | b_i);
    if (rst_i) y_q <= 1'b0;
  end
  assign y_o = y_q;
endmodule
`default_nettype wire
