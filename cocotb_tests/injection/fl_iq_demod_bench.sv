// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// fl_iq_demod with its multiplier.
`default_nettype none
module fl_iq_demod_bench
  import fl_pkg::*;
  import fl_injection_pkg::*;
(
    input  logic                    clk_i,
    input  logic                    rst_i,
    input  logic                    start_i,
    input  sample_t [ 1:0]          current_i,
    input  phase_t                  phase_i,
    input  sample_t                 cosine_i,
    input  sample_t                 sine_value_i,
    input  logic                    clear_i,
    input  logic                    sine_i,
    input  phase_t                  period_i,
    output logic                    busy_o,
    output logic                    valid_o,
    output logic    [ 1:0][1:0][31:0] sum_o,
    output logic    [11:0]          count_o,
    output logic                    overflow_o,
    output logic    [15:0]          overrun_o
);

  mac_t mac;
  sum_t sum;

  fl_iq_demod u_iq_demod (
      .mac_o(mac),
      .sum_i(sum),
      .*
  );

  fl_injection_mac u_mac (
      .clk_i,
      .rst_i,
      .request_i(mac),
      .sum_o    (sum)
  );

endmodule
`default_nettype wire
