// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// fl_angle_time with its divider.
`default_nettype none
module angle_bench (
    input  logic        clk_i,
    input  logic        rst_i,
    input  logic        start_i,
    input  logic [16:0] value_i,
    input  logic [16:0] peak_i,
    input  logic [23:0] interval_i,
    input  logic        linear_i,
    output logic        busy_o,
    output logic        valid_o,
    output logic [24:0] distance_o,
    output logic        saturated_o
);

  logic div_start, div_valid;
  logic [16:0] div_before, div_after;
  logic [15:0] div_offset;
  logic [24:0] distance;
  logic half;

  assign distance_o = distance + 25'(half);

  fl_angle_time u_angle (
      .div_start_o (div_start),
      .div_before_o(div_before),
      .div_after_o (div_after),
      .div_valid_i (div_valid),
      .div_offset_i(div_offset),
      .distance_o  (distance),
      .half_o      (half),
      .*
  );

  fl_interpolator u_divider (
      .clk_i,
      .rst_i,
      .start_i (div_start),
      .abort_i (div_start),
      .gap_i   ('1),
      .before_i(div_before),
      .after_i (div_after),
      .busy_o  (),
      .valid_o (div_valid),
      .offset_o(div_offset)
  );

endmodule
`default_nettype wire
