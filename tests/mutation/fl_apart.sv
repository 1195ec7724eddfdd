// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Block of the proof's own test: defects that change a register and no output.
`default_nettype none
module fl_apart (
    input  logic       clk_i,
    input  logic       rst_i,
    input  logic       run_i,
    input  logic [3:0] word_i,
    output logic       changed_o,
    output logic       full_o,
    output logic       old_o
);
  logic busy_q, parity_q;
  logic [2:0] count_q;
  logic [7:0] age_q;
  always_ff @(posedge clk_i) begin
    busy_q <= run_i;
    // The parity itself is not told, only whether it differs.
    if (!busy_q) parity_q <= ^word_i;
    changed_o <= busy_q && (^word_i) != parity_q;
    // Looked at while busy_q: that it is cleared when busy_q is 0 would do.
    count_q <= (run_i && busy_q) ? count_q + 3'd1 : '0;
    full_o  <= busy_q && count_q == 3'd7;
    // Any end above 199 would do, which takes 200 clocks to tell.
    if (!run_i) age_q <= '0;
    else if (age_q != 8'd255) age_q <= age_q + 8'd1;
    if (rst_i) begin
      busy_q    <= 1'b0;
      changed_o <= 1'b0;
      full_o    <= 1'b0;
      age_q     <= '0;
    end
  end
  assign old_o = age_q >= 8'd200;
endmodule
`default_nettype wire
