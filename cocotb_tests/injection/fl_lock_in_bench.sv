// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// fl_lock_in with its multiplier.
`default_nettype none
module fl_lock_in_bench
  import fl_pkg::*;
  import fl_injection_pkg::*;
(
    input  logic           clk_i,
    input  logic           rst_i,
    input  logic           start_i,
    input  sample_t [ 1:0] current_i,
    input  sample_t        reference_i,
    input  logic           clear_i,
    input  logic           sine_i,
    input  filter_t        band_i,
    input  sample_t        band_k_i,
    input  filter_t        low_i,
    input  logic    [ 2:0] shift_i,
    output logic           busy_o,
    output logic           hf_valid_o,
    output logic           valid_o,
    output sample_t [ 1:0] hf_o,
    output state_t         error_o,
    output state_t         magnitude_o,
    output logic    [15:0] clipped_o,
    output logic    [15:0] overrun_o
);

  mac_t mac;
  sum_t sum;

  fl_lock_in u_lock_in (
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
