// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Pulse every period_i clocks.
//
// period_i = 0 stops it at once; from stop the first pulse follows period_i + 1 clocks after the period appeared, then
// one every period_i clocks exactly. Another period takes effect at the next pulse, but never leaves more than itself
// to wait. Latency: pulse_o is registered.
`default_nettype none
module fl_interval #(
    parameter int unsigned Width = 32
) (
    input  logic             clk_i,
    input  logic             rst_i,
    input  logic [Width-1:0] period_i,   // clocks
    output logic             pulse_d_o,  // pulse_o of the next clock
    output logic             pulse_o
);

  logic [Width-1:0] left_q;  // clocks to the pulse, 0: stopped
  logic running;

  assign running   = period_i != '0;
  assign pulse_d_o = running && left_q == Width'(1);

  always_ff @(posedge clk_i) begin
    pulse_o <= pulse_d_o;
    if (!running) left_q <= '0;
    else if (left_q <= Width'(1) || left_q > period_i) left_q <= period_i;
    else left_q <= left_q - 1'b1;
    if (rst_i) begin
      pulse_o <= 1'b0;
      left_q  <= '0;
    end
  end

endmodule
`default_nettype wire
