// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Test wrapper: carrier, sequencer, guard and PWM state wired as on the chip, with a free-running time and every
// observed signal packed into one vector, so that the test bench reads it once a clock.
`default_nettype none
module fl_pwm_chain
  import fl_pkg::*;
#(
    localparam int unsigned Phases = 3
) (
    input  logic                clk_i,
    input  logic                rst_i,
    input  logic                update_i,
    input  logic [         1:0] cfg_commutation_i,
    input  logic [        15:0] cfg_period_i,
    input  logic [        23:0] cfg_duty_q8_i,
    input  logic [        11:0] cfg_min_pulse_i,
    input  logic [         1:0] cfg_mode_i,
    input  logic [         1:0] cfg_pattern_i,
    input  logic                cfg_sync_rect_i,
    input  logic                cfg_reverse_i,
    input  logic [         2:0] cfg_start_sector_i,
    input  logic                cfg_start_hall_i,
    input  logic [         2:0] hall_position_i,
    input  logic                hall_ok_i,
    input  logic                load_i,
    input  logic [         2:0] load_sector_i,
    input  logic [3*Phases-1:0] cfg_manual_i,
    input  logic                comm_valid_i,
    input  logic                sched_valid_i,
    input  logic [        31:0] comm_sched_i,
    input  logic                enable_i,
    input  logic                trip_i,
    input  logic [         9:0] dead_time_i,
    output logic [       255:0] trace_o
);

  stamp_t now;
  pwm_state_t state;
  sector_t sector;
  logic pulse, start, apply, comm_applied, active;
  logic [15:0] count, dropped;
  logic [Phases-1:0] req_h, req_l;
  logic [2*Phases-1:0] gate;
  leg_cmd_e [Phases-1:0] leg_cmd;
  logic [Phases-1:0] gate_h, gate_l;

  always_ff @(posedge clk_i) now <= rst_i ? '0 : now + 1;

  fl_carrier u_carrier (
      .clk_i,
      .rst_i,
      .now_i            (now),
      .update_i,
      .cfg_commutation_i(comm_alignment_e'(cfg_commutation_i)),
      .cfg_period_i,
      .cfg_duty_q8_i,
      .cfg_min_pulse_i,
      .comm_valid_i,
      .sched_valid_i,
      .comm_sched_i,
      .apply_o          (apply),
      .pulse_o          (pulse),
      .carrier_start_o  (start),
      .count_o          (count),
      .dropped_o        (dropped)
  );

  fl_sequencer #(
      .Phases(Phases)
  ) u_sequencer (
      .clk_i,
      .rst_i,
      .update_i,
      .cfg_mode_i    (seq_mode_e'(cfg_mode_i)),
      .cfg_pattern_i (chop_pattern_e'(cfg_pattern_i)),
      .cfg_sync_rect_i,
      .cfg_reverse_i,
      .cfg_start_sector_i,
      .cfg_start_hall_i,
      .hall_position_i,
      .hall_ok_i,
      .load_i,
      .load_sector_i,
      .cfg_manual_i  (cfg_manual_i),
      .apply_i       (apply),
      .pulse_i       (pulse),
      .sector_o      (sector),
      .active_o      (active),
      .comm_applied_o(comm_applied),
      .leg_cmd_o     (leg_cmd),
      .req_h_o       (req_h),
      .req_l_o       (req_l)
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

  fl_pwm_state #(
      .Phases(Phases)
  ) u_state (
      .clk_i,
      .rst_i,
      .gate_i        (gate),
      .sector_i      (sector),
      .active_i      (active),
      .comm_applied_i(comm_applied),
      .state_o       (state)
  );

  // The last whole carrier: its clocks, and those of them with the pulse on.
  logic [16:0] length_q, on_q, last_length_q, last_on_q;
  always_ff @(posedge clk_i) begin
    length_q <= start ? 17'd1 : length_q + 17'd1;
    on_q     <= start ? 17'(pulse) : on_q + 17'(pulse);
    if (start) begin
      last_length_q <= length_q;
      last_on_q     <= on_q;
    end
  end

  // The field order of chain.py, from bit 0 upwards.
  assign trace_o = 256'({
    gate_l,
    gate_h,
    last_on_q,
    last_length_q,
    now,
    leg_cmd,
    dropped,
    state,
    gate,
    req_l,
    req_h,
    active,
    sector,
    comm_applied,
    apply,
    count,
    start,
    pulse
  });

endmodule
`default_nettype wire
