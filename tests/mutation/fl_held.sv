// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Block of the proof's own test: no reset, but a hold that acts a clock later.
`default_nettype none
module fl_held (
    input  logic clk_i,
    input  logic hold_i,
    input  logic run_i,
    output logic full_o
);
  logic hold_q, busy_q;
  logic [2:0] count_q;
  always_ff @(posedge clk_i) begin
    hold_q <= hold_i;
    busy_q <= run_i;
    // Looked at while busy_q: that it is cleared when busy_q is 0 would do.
    count_q <= (run_i && busy_q) ? count_q + 3'd1 : '0;
    full_o  <= busy_q && count_q == 3'd7;
    if (hold_q) begin
      busy_q <= 1'b0;
      full_o <= 1'b0;
    end
  end
endmodule
`default_nettype wire
