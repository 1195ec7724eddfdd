// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Square-wave injection locked to the carrier: the voltage to add at each update, its phase, the phase of the sample.
//
//   v = amplitude * square(phase),   phase = 0..period-1, one further at each update
//   square = +1 for phase < floor(period/2), -1 in the second half; 0 in the middle of an odd period, so that its mean is 0
// Every integer number of updates an injection period; with double update a carrier has two. period 4 is ++--.
//
// phase_o and voltage_o belong to the step that runs now: they act from the next update_i on. zero_o: there the HF current
// crosses zero (period divisible by 4), the instant at which a fundamental voltage may change.
// Start: with enable_i at an update in a carrier's first half (second_i low), at phase first_i: a quarter of the period
// starts in the middle of the positive half, and the HF current has no offset. Amplitude and enable_i are taken over at
// phase first_i only, period and first_i at the start: all periods are whole.
//
// Sample: at strobe_i (its clock; that of update_i still counts to the old phase) phase_sample_o takes phase_o - delay_i
// modulo the period. delay 2: the voltage whose effect ended at the latest update; 1: the voltage that acts now.
// angle_sample_o takes the angle of the applied wave, 2^32 = one turn, 0 at the rising edge of the voltage: it is zeroed
// at the update at which phase 0 begins to act and grows by rate_i (2^-36 turn a clock) every clock. Right from the first
// phase 0 after the start on. Both are seen one clock after strobe_i.
//
// Formats: voltages signed 18 bits, 2^17 = full scale; -(-2^17) saturates. period 2..4095, first_i and delay_i below it
// (asserted). Idle: voltage 0, phase first_i as last used. Latency: update_i to voltage_o, phase_o 1 clock.
`default_nettype none
module fl_injection
  import fl_pkg::sample_t;
  import fl_injection_pkg::*;
#(
    parameter int unsigned Subspaces = 2
) (
    input logic clk_i,
    input logic rst_i,

    input logic update_i,  // of the leg carriers
    input logic second_i,  // the carrier's second half begins
    input logic strobe_i,  // the converter samples

    input logic                                 enable_i,
    input phase_t                               period_i,     // updates
    input phase_t                               first_i,      // updates
    input phase_t                               delay_i,      // updates
    input logic    [              31:0]         rate_i,       // 2^-36 turn a clock
    input sample_t [Subspaces-1:0][ 1:0]        amplitude_i,

    output logic                          active_o,
    output sample_t [Subspaces-1:0][ 1:0] voltage_o,
    output phase_t                        phase_o,
    output logic                          zero_o,
    output phase_t                        period_o,        // in use
    output phase_t                        phase_sample_o,
    output logic    [            31:0]    angle_sample_o
);

  if (Subspaces < 1 || Subspaces > 2) begin : gen_illegal
    $fatal(1, "fl_injection: Subspaces must be 1 or 2 (%m)");
  end

  logic active_q, start, wrap;
  phase_t phase_q, next_q, period_q, first_q, sample_q;
  logic [35:0] angle_q;
  logic [31:0] angle_sample_q;
  sample_t [Subspaces-1:0][1:0] amplitude_q;

  function automatic phase_t following(phase_t phase, phase_t period);
    return (phase + phase_t'(1) == period) ? '0 : phase + phase_t'(1);
  endfunction

  assign start = update_i && !active_q && enable_i && !second_i;
  assign wrap  = update_i && active_q && next_q == first_q;

  always_ff @(posedge clk_i) begin
    if (start) begin
      active_q <= 1'b1;
      phase_q  <= first_i;
      next_q   <= following(first_i, period_i);
      period_q <= period_i;
      first_q  <= first_i;
    end else if (update_i && active_q) begin
      active_q <= !wrap || enable_i;
      phase_q  <= next_q;
      next_q   <= following(next_q, period_q);
    end
    if (start || wrap) amplitude_q <= amplitude_i;
    angle_q <= (update_i && active_q && phase_q == '0) ? '0 : angle_q + {4'd0, rate_i};
    if (strobe_i) begin
      sample_q       <= (phase_q >= delay_i) ? phase_q - delay_i : phase_q + period_q - delay_i;
      angle_sample_q <= angle_q[35:4];
    end
    if (rst_i) begin
      active_q       <= 1'b0;
      phase_q        <= '0;
      next_q         <= phase_t'(1);
      period_q       <= phase_t'(2);
      first_q        <= '0;
      amplitude_q    <= '0;
      angle_q        <= '0;
      sample_q       <= '0;
      angle_sample_q <= '0;
    end
  end

  function automatic sample_t negative(sample_t x);
    return (x == {1'b1, 17'd0}) ? {1'b0, {17{1'b1}}} : -x;
  endfunction

  logic signed [1:0] sign;
  assign sign = square(phase_q, period_q);

  always_comb begin
    for (int unsigned s = 0; s < Subspaces; s++)
    for (int unsigned axis = 0; axis < 2; axis++)
    unique case (sign)
      2'sd1:   voltage_o[s][axis] = active_q ? amplitude_q[s][axis] : '0;
      -2'sd1:  voltage_o[s][axis] = active_q ? negative(amplitude_q[s][axis]) : '0;
      default: voltage_o[s][axis] = '0;
    endcase
  end

  assign active_o       = active_q;
  assign phase_o        = phase_q;
  assign zero_o         = active_q && (phase_q == period_q >> 2 || phase_q == (period_q >> 1) + (period_q >> 2));
  assign period_o       = period_q;
  assign phase_sample_o = sample_q;
  assign angle_sample_o = angle_sample_q;

  always_ff @(posedge clk_i) begin
    if (!rst_i && start) begin
      assert (period_i >= phase_t'(2) && first_i < period_i && delay_i < period_i)
      else $error("fl_injection: period from 2, first and delay below it");
    end
  end

endmodule
`default_nettype wire
