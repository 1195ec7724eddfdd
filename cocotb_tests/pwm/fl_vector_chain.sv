// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Test wrapper: modulator, leg carriers and guard wired as the vector path uses them, with every observed signal packed
// into one vector. A vector is converted whenever sample_i is high.
`default_nettype none
module fl_vector_chain
  import fl_pkg::*;
#(
    parameter int unsigned Phases = 3
) (
    input  logic                    clk_i,
    input  logic                    rst_i,
    input  logic                    enable_i,
    input  logic                    trip_i,
    input  logic                    sample_i,
    input  logic [   18*Phases-1:0] v_q17_i,
    input  logic [   18*Phases-1:0] i_q17_i,
    input  logic                    cfg_double_i,
    input  logic [             7:0] cfg_miss_limit_i,
    input  logic [            15:0] cfg_period_i,
    input  logic [            16:0] cfg_scale_i,
    input  logic [             4:0] cfg_scale_shift_i,
    input  logic [            16:0] cfg_band_i,
    input  logic [            16:0] cfg_slope_i,
    input  logic [             4:0] cfg_slope_shift_i,
    input  logic [             9:0] cfg_dead_time_i,
    input  logic [            11:0] cfg_min_pulse_i,
    input  logic [            15:0] cfg_margin_i,
    input  logic [             9:0] dead_time_i,
    output logic [4*Phases+36-1:0] trace_o
);

  logic valid, update, start, second, active, fault;
  logic [Phases-1:0][15:0] compare;
  logic [15:0] period, count, missed;
  logic [Phases-1:0] clipped, req_h, req_l, gate_h, gate_l;
  logic [2*Phases-1:0] gate;

  fl_modulator #(
      .Phases(Phases)
  ) u_modulator (
      .clk_i,
      .rst_i,
      .early_i  (1'b0),
      .valid_i  (sample_i),
      .pair_i   (1'b0),
      .v_q17_i,
      .i_q17_i,
      .cfg_period_i,
      .cfg_scale_i,
      .cfg_scale_shift_i,
      .cfg_band_i,
      .cfg_slope_i,
      .cfg_slope_shift_i,
      .cfg_dead_time_i,
      .cfg_min_pulse_i,
      .cfg_margin_i,
      .valid_o  (valid),
      .compare_o(compare),
      .period_o (period),
      .clipped_o(clipped)
  );

  fl_leg_carrier #(
      .Phases(Phases)
  ) u_carrier (
      .clk_i,
      .rst_i,
      .enable_i,
      .cfg_double_i,
      .cfg_period_i,
      .cfg_miss_limit_i,
      .compare_valid_i(valid),
      .compare_i      (compare),
      .period_i       (period),
      .update_o       (update),
      .carrier_start_o(start),
      .second_o       (second),
      .count_o        (count),
      .active_o       (active),
      .missed_o       (missed),
      .fault_o        (fault),
      .req_h_o        (req_h),
      .req_l_o        (req_l)
  );

  fl_gate_guard #(
      .Phases(Phases)
  ) u_guard (
      .clk_i,
      .rst_i,
      .enable_i,
      .dead_time_i,
      .trip_i,
      .short_i          (1'b0),
      .req_h_i          (req_h),
      .req_l_i          (req_l),
      .gate_h_o         (gate_h),
      .gate_l_o         (gate_l),
      .gate_o           (gate)
  );

  assign trace_o = {count, missed, fault, second, start, update, gate_l, gate_h, req_l, req_h};

endmodule
`default_nettype wire
