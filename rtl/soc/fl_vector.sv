// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Vector path: from the samples of the phase currents to the requests of the legs, closed in hardware.
//
//   update -> window -> (mean current, angle of its instant) -> regulators -> modulator -> shadow registers -> update
//
// Every update_o of the leg carriers opens a current window. The window's mean starts fl_foc, with the angle that the
// accumulator had at the window's instant. fl_foc starts the modulator. The modulator's compares wait for the next update.
// Equations: fl_foc, fl_modulator, fl_angle_nco. Formats: angles 2^32 = one turn, speed 2^-36 turn per clock, currents and
// voltages signed 18 bits, 2^17 = full scale.
//
// Settings are staged. All of them act together, at update_i or in the first clock after it in which no regulator step
// runs or starts. So they do after reset. Speed and correction of the angle act at update_i itself (fl_angle_nco). The
// block takes a speed over in the clock after it appeared.
//
// Angles: the gate pins change at update_o + 1, and settings.from clocks later is the window's first clock. theta_update
// is the angle in that clock of the pins. So theta_update and the angles of samples differ by omega times the time between
// them. The angle belongs to the instant of the samples' strobes: settings.delay is not taken from it.
//
// Latency, whatever the values: from sample_valid_i of the window's last sample to compares in the shadow registers
// 1 (one sample) or 8 (mean) + fl_foc + fl_modulator + 1 clocks: 66 or 73 for three phases, 117 or 124 for five.
// sync_o is one clock before that.
//
// Errors:
//   - two updates closer than fl_foc needs: the block ignores and counts a window that comes while fl_foc runs,
//   - a step that has not ended at update_o is abandoned. The legs keep their compares. The block counts it as missed and
//     ignores an answer to it.
//
// Modes:
//   direct     settings.direct: a step waits with its currents in question_o for the core's answer_i, which is not staged
//   injection  fl_injection_path makes injection_i from tap_o. What it pauses comes on top of the latency. The voltages of
//              steps and sums are those of the regulators, without the injected one.
//   edges      injection_i.edges: the modulator gets the currents at the edges of the legs (fl_edge_current) and no band.
//              With double update it gets those of the edge in the half in which the voltage acts, else those of both.
//
// Snapshot at tick_i: the last regulator step before it, and the sum of the applied voltages over the steps since the tick
// before (saturates at 32 bits) with the number of these steps.
`default_nettype none
module fl_vector
  import fl_pkg::*;
  import fl_vector_pkg::*;
#(
    parameter  int unsigned Phases    = 3,
    localparam int unsigned Subspaces = fl_foc_pkg::subspaces(Phases)
) (
    input logic      clk_i,
    input logic      rst_i,
    input stamp_t    now_i,
    input logic      tick_i,
    input logic      update_i,
    input settings_t settings_i,

    input logic signed [31:0] omega_i,       // 2^-36 turn a clock
    input logic               correct_we_i,
    input logic        [31:0] correct_i,     // signed, 2^32 = one turn

    input logic                 strobe_i,        // the converter samples
    input logic                 sample_valid_i,
    input sample_t [Phases-1:0] sample_i,        // phase currents
    input stamp_t               sample_time_i,
    input encoder_t             encoder_i,       // of this clock
    input answer_t              answer_i,
    input injection_t           injection_i,

    output tap_t                tap_o,       // for the injection path
    output question_t           question_o,

    output logic                   source_o,    // setting in use
    output logic                   update_o,    // of the leg carriers
    output logic                   sync_o,      // pulse: compares of a step are made
    output logic                   deadline_o,  // fault of the leg carriers
    output logic      [Phases-1:0] req_h_o,
    output logic      [Phases-1:0] req_l_o,
    output logic                   instant_o,   // instant of a window
    output logic            [31:0] theta_o,     // of this clock, 2^32 = one turn
    output snapshot_t              snapshot_o
);

  // Settings in use.
  settings_t settings_q;
  logic waiting_q, apply;  // an update event, or the end of the reset, waits for the end of a regulator step
  logic foc_busy, foc_start;

  assign apply = (update_i || waiting_q) && !foc_busy && !foc_start;

  always_ff @(posedge clk_i) begin
    waiting_q <= (update_i || waiting_q) && !apply;
    if (apply) settings_q <= settings_i;
    if (rst_i) begin
      waiting_q  <= 1'b1;
      settings_q <= '0;
    end
  end

  // Angle.
  logic instant, pins_q;
  logic [31:0] theta_sample, theta_update;
  logic signed [31:0] omega;

  always_ff @(posedge clk_i) pins_q <= update_o && !rst_i;

  fl_angle_nco u_angle (
      .clk_i,
      .rst_i,
      .update_i,
      .omega_we_i      (1'b1),
      .omega_i,
      .correct_we_i,
      .correct_i,
      .strobe_i        (instant),
      .carrier_update_i(pins_q),
      .theta_o,
      .theta_sample_o  (theta_sample),
      .theta_update_o  (theta_update),
      .omega_o         (omega)
  );

  // Currents and the angle that belongs to them: the next window's instant may come before the mean of this one.
  sample_t [Phases-1:0] current;
  stamp_t current_time;
  logic [7:0] samples;
  stamp_t [1:0] instant_time_q;  // the latest in the lowest place
  logic [31:0] older_theta_q, theta;
  encoder_t [1:0] instant_encoder_q;
  encoder_t encoder;
  logic older;

  fl_current_window #(
      .Phases(Phases)
  ) u_window (
      .clk_i,
      .rst_i,
      .now_i,
      .start_i     (update_o),
      .cfg_from_i  (settings_q.from),
      .cfg_length_i(settings_q.length),
      .cfg_delay_i (settings_q.delay),
      .strobe_i,
      .sample_valid_i,
      .sample_i,
      .sample_time_i,
      .instant_o   (instant),
      .valid_o     (foc_start),
      .current_o   (current),
      .time_o      (current_time),
      .samples_o   (samples)
  );

  assign older   = current_time == instant_time_q[1];
  assign theta   = older ? older_theta_q : theta_sample;
  assign encoder = instant_encoder_q[older];

  always_ff @(posedge clk_i) begin
    if (instant) begin
      instant_time_q    <= {instant_time_q[0], now_i - stamp_t'(settings_q.delay)};
      older_theta_q     <= theta_sample;
      instant_encoder_q <= {instant_encoder_q[0], encoder_i};
    end
    if (rst_i) begin
      instant_time_q    <= '0;
      older_theta_q     <= '0;
      instant_encoder_q <= '0;
    end
  end

  assign instant_o = instant;

  // Regulators.
  logic [31:0] run_theta_q;  // of the step
  logic foc_valid;
  sample_t [Phases-1:0] voltage;
  sample_t [Subspaces-1:0][1:0] foc_current, foc_applied;
  logic [Subspaces-1:0][1:0][27:0] foc_state;
  logic [Subspaces-1:0] foc_limited;
  logic [15:0] overruns;

  fl_foc #(
      .Phases(Phases)
  ) u_foc (
      .clk_i,
      .rst_i,
      .start_i    (foc_start),
      .current_i  (current),
      .theta_i    (theta),
      .park_i     (settings_q.park),
      .lead_i     (settings_q.lead),
      .enable_i   (settings_q.regulate[Subspaces-1:0]),
      .bypass_i   (settings_q.bypass),
      .reference_i(settings_q.current_reference[Subspaces-1:0]),
      .gain_i     (settings_q.gain[Subspaces-1:0]),
      .hold_i     (settings_q.hold[Subspaces-1:0]),
      .ratio_i    (settings_q.ratio[Subspaces-1:0]),
      .shift_i    (settings_q.shift[Subspaces-1:0]),
      .limit_i    (settings_q.limit[Subspaces-1:0]),
      .preset_i   (settings_q.preset[Subspaces-1:0]),
      .forward_i  (settings_q.forward[Subspaces-1:0]),
      .pause_i    (injection_i.pause),
      .skip_i     (injection_i.skip),
      .filtered_i (injection_i.current),
      .inject_i   (injection_i.voltage[Subspaces-1:0]),
      .first_o    (tap_o.sample_valid),
      .direct_i   (settings_q.direct),
      .wanted_i   (answer_i.wanted[Subspaces-1:0]),
      .go_i       (answer_i.go),
      .go_number_i(answer_i.number),
      .abandon_i  (update_o),
      .waiting_o  (question_o.waiting),
      .number_o   (question_o.number),
      .busy_o     (foc_busy),
      .valid_o    (foc_valid),
      .voltage_o  (voltage),
      .current_o  (foc_current),
      .applied_o  (foc_applied),
      .state_o    (foc_state),
      .limited_o  (foc_limited),
      .overrun_o  (overruns)
  );

  // Currents for the dead time: those of the sample or those at the edges to come. The carrier's first half has the
  // rising edges; a voltage acts in the half after that of its step.
  logic edges_q, falls_q, step_start, ahead_valid, both_edges;
  sample_t [1:0][Phases-1:0] ahead;
  sample_t [Phases-1:0] lost_current;

  assign step_start = foc_start && !foc_busy;
  assign both_edges = edges_q && !settings_q.double_update;

  always_ff @(posedge clk_i) begin
    if (step_start) begin
      edges_q <= injection_i.edges;
      falls_q <= !tap_o.second;
    end
    if (rst_i) begin
      edges_q <= 1'b0;
      falls_q <= 1'b0;
    end
  end

  fl_edge_current #(
      .Phases(Phases)
  ) u_edges (
      .clk_i,
      .rst_i,
      .enable_i (injection_i.edges),
      .update_i (update_o),
      .req_h_i  (req_h_o),
      .sample_valid_i,
      .sample_i,
      .start_i  (step_start),
      .current_i(current),
      .phase_i  (injection_i.phase),
      .valid_o  (ahead_valid),
      .ahead_o  (ahead)
  );

  always_comb begin
    if (!edges_q) lost_current = current;
    else if (both_edges) lost_current = ahead[foc_valid];
    else lost_current = ahead[falls_q];
  end

  // Modulator and leg carriers.
  logic [Phases-1:0][15:0] compare;
  logic [15:0] period, missed;

  fl_modulator #(
      .Phases(Phases)
  ) u_modulator (
      .clk_i,
      .rst_i,
      .early_i          (ahead_valid && both_edges),
      .valid_i          (foc_valid),
      .pair_i           (both_edges),
      .v_q17_i          (voltage),
      .i_q17_i          (lost_current),
      .cfg_period_i     (settings_q.period),
      .cfg_scale_i      (settings_q.scale),
      .cfg_scale_shift_i(settings_q.scale_shift),
      .cfg_band_i       (edges_q ? '0 : settings_q.band),
      .cfg_slope_i      (settings_q.slope),
      .cfg_slope_shift_i(settings_q.slope_shift),
      .cfg_dead_time_i  (settings_q.dead_time),
      .cfg_min_pulse_i  (settings_q.min_pulse),
      .cfg_margin_i     (settings_q.margin),
      .valid_o          (sync_o),
      .compare_o        (compare),
      .period_o         (period),
      .clipped_o        ()
  );

  fl_leg_carrier #(
      .Phases(Phases)
  ) u_carrier (
      .clk_i,
      .rst_i,
      .enable_i        (settings_q.enable),
      .cfg_double_i    (settings_q.double_update),
      .cfg_period_i    (settings_q.period),
      .cfg_miss_limit_i(settings_q.miss_limit),
      .compare_valid_i (sync_o),
      .compare_i       (compare),
      .period_i        (period),
      .update_o,
      .carrier_start_o (),
      .second_o        (tap_o.second),
      .count_o         (),
      .active_o        (),
      .missed_o        (missed),
      .fault_o         (deadline_o),
      .req_h_o,
      .req_l_o
  );

  assign source_o      = settings_q.source;
  assign tap_o.update  = update_o;
  assign tap_o.strobe  = instant;
  assign tap_o.current = foc_current[0];
  assign tap_o.theta   = run_theta_q;

  always_comb begin
    question_o.current = '0;
    for (int unsigned s = 0; s < Subspaces; s++)
    for (int unsigned axis = 0; axis < 2; axis++)
    question_o.current[s][axis] = 32'($signed(foc_current[s][axis]));
  end

  // The last step: complete from its end to the end of the next.
  step_t step_d, step_q;
  stamp_t run_stamp_q;
  logic [7:0] run_samples_q;
  encoder_t run_encoder_q;

  always_comb begin
    step_d = '0;
    for (int unsigned s = 0; s < Subspaces; s++) begin
      step_d.limited[s] = foc_limited[s];
      for (int unsigned axis = 0; axis < 2; axis++) begin
        step_d.current[s][axis] = 32'($signed(foc_current[s][axis]));
        step_d.applied[s][axis] = 32'($signed(foc_applied[s][axis]));
        step_d.state[s][axis]   = 32'($signed(foc_state[s][axis]));
      end
    end
    step_d.theta   = run_theta_q;
    step_d.stamp   = run_stamp_q;
    step_d.samples = run_samples_q;
    step_d.encoder = run_encoder_q;
  end

  // Sums since the tick.
  wide_vectors_t sum_q;
  logic [15:0] steps_q;
  snapshot_t snapshot_q;

  function automatic logic [31:0] sat_sum(logic [31:0] sum, logic [31:0] x);
    logic [32:0] y;
    y = {sum[31], sum} + {x[31], x};
    return (y[32] == y[31]) ? y[31:0] : {y[32], {31{!y[32]}}};
  endfunction

  always_ff @(posedge clk_i) begin
    if (step_start) begin
      run_theta_q   <= theta;
      run_stamp_q   <= current_time;
      run_samples_q <= samples;
      run_encoder_q <= encoder;
    end
    if (foc_valid) begin
      step_q <= step_d;
      for (int unsigned s = 0; s < Subspaces; s++)
      for (int unsigned axis = 0; axis < 2; axis++)
      sum_q[s][axis] <= sat_sum(tick_i ? '0 : sum_q[s][axis], step_d.applied[s][axis]);
      steps_q <= tick_i ? 16'd1 : (steps_q == '1) ? steps_q : steps_q + 16'd1;
    end else if (tick_i) begin
      sum_q   <= '0;
      steps_q <= '0;
    end
    if (tick_i) begin
      snapshot_q <= '{
          step: step_q,
          applied_sum: sum_q,
          steps: steps_q,
          theta_update: theta_update,
          omega: omega,
          missed: missed,
          overruns: overruns
      };
    end
    if (rst_i) begin
      run_theta_q   <= '0;
      run_stamp_q   <= '0;
      run_samples_q <= '0;
      run_encoder_q <= '0;
      step_q        <= '0;
      sum_q         <= '0;
      steps_q       <= '0;
      snapshot_q    <= '0;
    end
  end

  assign snapshot_o = snapshot_q;

endmodule
`default_nettype wire
