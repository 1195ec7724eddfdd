// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Injection path: square wave to add to the voltage, HF part of the current out of the regulators' input, and what the
// chosen method finds in the current.
//
//   update -> fl_injection -> voltage; strobe -> phase, angle; current -> fl_lock_in -> fl_iq_demod -> result
//                                                              current -> fl_separator
// Method         result (index 0: d, 1: q)                                   a result
//   lock-in       re[1] error, re[0] magnitude of fl_lock_in, 2^21 = full scale every sample
//   conventional  the same with sin(angle - lag) as reference                   every sample
//   I/Q           re, im: sums of fl_iq_demod at angle - lag, 2^19 count = full scale    every injection period
//   separator     re: amplitudes of fl_separator, 2^18 = full scale             twice an injection period
// For a wave U square(phase) the voltage's fundamental is 4/pi U sin(angle); the current of an inductance lags by a
// quarter: lag = 2^30 + the delay of the chain makes its reference. The band-pass runs with every method.
// current_o: i - h with remove (band-passed part, saturated), with the separator the latest zero-crossing sample, i
// itself before the first one; without remove i itself. current_valid_o with each one that is new. current_delay_o: clocks
// from a sample that comes now to its current_o, 0 without remove and from the second update after the wave's end on.
//
// strobe_i latches phase and angle, sample_valid_i brings the current of that strobe: before the next one.
// Latency of sample_valid_i, in clocks: current_valid_o CurrentLatency, results of lock-in and conventional LockInLatency,
// I/Q (with the first sample of the next period) IqLatency, separator SeparatorLatency with its current. busy_o from
// sample_valid_i on for BusyClocks; a sample in between is ignored and counted in overrun_o. settings_i must not change while busy_o, but
// what fl_injection takes over at a period's start may at any time.
// One multiplier for all methods (fl_injection_mac), another one and a block RAM for the sine (fl_sincos).
`default_nettype none
module fl_injection_path
  import fl_pkg::*;
  import fl_injection_pkg::*;
#(
    parameter int unsigned Subspaces = 2,
    localparam int unsigned CurrentLatency = 19,
    localparam int unsigned LockInLatency = 40,
    localparam int unsigned IqLatency = 41,
    localparam int unsigned SeparatorLatency = 2,
    localparam int unsigned BusyClocks = 48
) (
    input logic clk_i,
    input logic rst_i,

    input settings_t settings_i,
    input logic      clear_i,     // filters, sums and samples start anew

    input logic          update_i,
    input logic          second_i,
    input logic          strobe_i,
    input logic          sample_valid_i,
    input sample_t [1:0] current_i,       // d, q of subspace 1

    output logic                          active_o,
    output logic                          begun_o,  // at the latest update
    output sample_t [Subspaces-1:0][ 1:0] voltage_o,
    output phase_t                        phase_o,
    output logic                          zero_o,

    output logic                 current_valid_o,
    output sample_t [ 1:0]       current_o,
    output logic          [ 4:0] current_delay_o,
    output phase_t               sample_phase_o,  // of the sample in work, else of the latest
    output sample_t [ 1:0]       hf_o,
    output logic                 result_valid_o,
    output result_t              result_o,
    output logic          [11:0] count_o,         // samples of an I/Q result
    output logic                 peak_o,          // of a separator's result
    output logic                 overflow_o,
    output logic                 busy_o,
    output logic          [15:0] clipped_o,
    output logic          [15:0] overrun_o
);

  if (Subspaces < 1 || Subspaces > 2) begin : gen_illegal
    $fatal(1, "fl_injection_path: Subspaces must be 1 or 2 (%m)");
  end

  phase_t period, phase_sample;
  logic [31:0] angle_sample;

  fl_injection #(
      .Subspaces(Subspaces)
  ) u_injection (
      .clk_i,
      .rst_i,
      .update_i,
      .second_i,
      .strobe_i,
      .enable_i      (settings_i.enable),
      .period_i      (settings_i.period),
      .first_i       (settings_i.first),
      .delay_i       (settings_i.delay),
      .rate_i        (settings_i.rate),
      .amplitude_i   (settings_i.amplitude[Subspaces-1:0]),
      .active_o,
      .voltage_o,
      .phase_o,
      .zero_o,
      .period_o      (period),
      .phase_sample_o(phase_sample),
      .angle_sample_o(angle_sample)
  );

  // The sample of the update at which the wave ended still holds its HF current.
  logic before_q, waving;

  assign begun_o = active_o && !before_q;
  assign waving  = active_o || before_q;

  always_ff @(posedge clk_i) begin
    if (update_i) before_q <= active_o;
    if (rst_i) before_q <= 1'b0;
  end

  // The sample in work.
  logic take, run_q, lock_in_busy, lock_in_valid, hf_valid, iq_start, iq_busy, iq_valid;
  logic [15:0] overrun_q;
  sample_t [1:0] current_q;
  phase_t phase_q;
  logic [31:0] angle_q;

  assign busy_o = run_q || lock_in_busy || lock_in_valid || iq_busy;
  assign take   = sample_valid_i && !busy_o;

  always_ff @(posedge clk_i) begin
    run_q <= take;
    if (take) begin
      current_q <= current_i;
      phase_q   <= phase_sample;
      angle_q   <= angle_sample - settings_i.lag;
    end
    if (sample_valid_i && !take && overrun_q != '1) overrun_q <= overrun_q + 16'd1;
    if (rst_i) begin
      run_q     <= 1'b0;
      current_q <= '0;
      phase_q   <= '0;
      angle_q   <= '0;
      overrun_q <= '0;
    end
  end

  // Sine, then cosine.
  logic look_q, value_valid;
  sample_t value, sine_q, cosine_q;

  fl_sincos u_sincos (
      .clk_i,
      .rst_i,
      .valid_i (run_q),
      .angle_i (angle_q),
      .cosine_i(look_q),
      .scaled_i(1'b0),
      .valid_o (value_valid),
      .value_o (value)
  );

  logic value_valid_q;

  always_ff @(posedge clk_i) begin
    look_q        <= run_q;
    value_valid_q <= value_valid;
    if (value_valid) sine_q <= value;
    if (value_valid_q) cosine_q <= value;
    if (rst_i) begin
      look_q        <= 1'b0;
      value_valid_q <= 1'b0;
      sine_q        <= '0;
      cosine_q      <= '0;
    end
  end

  // One multiplier: the I/Q sums begin when the filters are done.
  mac_t lock_in_mac, iq_mac;
  sum_t sum;

  fl_injection_mac u_mac (
      .clk_i,
      .rst_i,
      .request_i(lock_in_mac | iq_mac),
      .sum_o    (sum)
  );

  state_t error, magnitude;

  fl_lock_in u_lock_in (
      .clk_i,
      .rst_i,
      .start_i    (run_q),
      .current_i  (current_q),
      .reference_i(sine_q),
      .clear_i,
      .sine_i     (settings_i.method == MethodConventional),
      .band_i     (settings_i.band),
      .band_k_i   (settings_i.band_k),
      .low_i      (settings_i.low),
      .shift_i    (settings_i.shift),
      .mac_o      (lock_in_mac),
      .sum_i      (sum),
      .busy_o     (lock_in_busy),
      .hf_valid_o (hf_valid),
      .valid_o    (lock_in_valid),
      .hf_o,
      .error_o    (error),
      .magnitude_o(magnitude),
      .clipped_o,
      .overrun_o  ()
  );

  logic [1:0][1:0][31:0] iq_sum;

  assign iq_start = lock_in_valid && settings_i.method == MethodIq;

  fl_iq_demod u_iq_demod (
      .clk_i,
      .rst_i,
      .start_i     (iq_start),
      .current_i   (current_q),
      .phase_i     (phase_q),
      .cosine_i    (cosine_q),
      .sine_value_i(sine_q),
      .clear_i     (clear_i || !active_o),
      .sine_i      (settings_i.sine),
      .period_i    (period),
      .mac_o       (iq_mac),
      .sum_i       (sum),
      .busy_o      (iq_busy),
      .valid_o     (iq_valid),
      .sum_o       (iq_sum),
      .count_o,
      .overflow_o,
      .overrun_o   ()
  );

  logic fundamental_valid, separator_valid, separate, fundamental_known_q;
  sample_t [1:0] fundamental;
  logic [1:0][19:0] amplitude;

  assign separate = settings_i.method == MethodSeparator;

  always_ff @(posedge clk_i) begin
    if (fundamental_valid) fundamental_known_q <= 1'b1;
    if (clear_i || !waving || rst_i) fundamental_known_q <= 1'b0;
  end

  fl_separator u_separator (
      .clk_i,
      .rst_i,
      .valid_i            (run_q && separate),
      .current_i          (current_q),
      .phase_i            (phase_q[1:0]),
      .clear_i            (clear_i || !waving),
      .fundamental_valid_o(fundamental_valid),
      .fundamental_o      (fundamental),
      .valid_o            (separator_valid),
      .peak_o,
      .hf_o               (),
      .amplitude_o        (amplitude)
  );

  always_comb begin
    for (int unsigned axis = 0; axis < 2; axis++) begin
      if (!settings_i.remove) current_o[axis] = current_q[axis];
      else if (separate) begin
        current_o[axis] = (fundamental_valid || fundamental_known_q) ? fundamental[axis] : current_q[axis];
      end
      else current_o[axis] = sat_sample(32'(current_q[axis]) - 32'(hf_o[axis]));
    end
  end

  always_comb begin
    result_o = '0;
    unique case (settings_i.method)
      MethodIq:
      for (int unsigned axis = 0; axis < 2; axis++) begin
        result_o.re[axis] = iq_sum[axis][0];
        result_o.im[axis] = iq_sum[axis][1];
      end
      MethodSeparator: begin
        for (int unsigned axis = 0; axis < 2; axis++) result_o.re[axis] = 32'($signed(amplitude[axis]));
      end
      default: begin
        result_o.re[0] = 32'($signed(magnitude));
        result_o.re[1] = 32'($signed(error));
      end
    endcase
  end

  assign current_valid_o = (separate && settings_i.remove) ? fundamental_valid : hf_valid;
  assign overrun_o       = overrun_q;
  assign sample_phase_o  = phase_q;

  always_comb begin
    if (!waving || !settings_i.remove) current_delay_o = '0;
    else if (separate) current_delay_o = 5'(SeparatorLatency);
    else current_delay_o = 5'(CurrentLatency);
  end

  always_comb begin
    unique case (settings_i.method)
      MethodIq:        result_valid_o = iq_valid;
      MethodSeparator: result_valid_o = separator_valid;
      default:         result_valid_o = lock_in_valid;
    endcase
  end

endmodule
`default_nettype wire
