// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/fixed.h"
#include "control/placement.h"
#include "control/trig.h"
#include "control/vector_speed.h"
#include "drive/vector/current.h"
#include "drive/vector/injected.h"
#include "drive/vector/parts.h"
#include "hal/chip.h"

#define QUARTER_TURN ((uint32_t)1 << 30)
#define SLIP_FIVE_MS 6u  // 30 ms
// A tick with pulses, ticks without: the current of the pulses is gone.
#define INSULATION_TICKS 4u
// Rated current over the peak of the wiring test's: for the current sensors, for the dividers, whose pulses reach at least this
// part of the link's voltage where a current of the first size bears more.
#define WIRING_SHARE 25
#define WIRING_VOLTAGE_SHARE 24
#define WIRING_LINK_PART 16

COLD void vector_frame_off(vector_t *v) {
  v->frame = FRAME_OFF;
  tell_speed(v, 0, false);
  vector_lead(v, 0);
  vector_turn(v, 0, false);
  v->report.gates = false;
  if (v->tests) {
    chip_shift_samples(v->p, 0);
  }
  v->tests = false;
  vector_doubt_encoder(v);
  vector_design_off(v);
  current_off(&v->command);
  if (vector_injects(v)) {
    vector_injection_off(v);
  }
}

void vector_frame_coast(vector_t *v) { v->report.phase = START_COAST; }

static void begin_forced(vector_t *v) {
  const complex_t zero = {0, 0};
  if_begin(&v->start);
  vector_start_current(v);
  v->slip_checks = 0;
  vector_observe_from(v, zero, zero);
  v->waiting_ticks = 0;
  v->frame = FRAME_FORCED;
  v->report.phase = START_ALIGN;
}

// Voltage along a phase's direction, from the frame if that is at the angle 0.
COLD static void pulse(vector_t *v, uint32_t leg, int32_t voltage_v_q25, uint32_t frame_turn_q32) {
  const complex_t direction = cis_q30(leg * (UINT32_MAX / PHASES) - frame_turn_q32);
  current_preset(&v->command, 0, complex_mul_q30((complex_t){voltage_v_q25, 0}, direction));
}

// A tick with the shortest pulses along each phase's direction from the frame in turn, between ticks without a voltage. A
// line has two in a carrier's period, each longer than the dead time by the shortest that a sample sees: a whole winding
// lets little current through, a short between two phases or from one to a rail trips. True: over.
COLD static bool check_insulation(vector_t *v) {
  const parameters_t *p = v->p;
  const uint32_t leg = v->waiting_ticks / INSULATION_TICKS;
  int32_t pulse_v_q25 = 0;
  if (v->waiting_ticks % INSULATION_TICKS == 0u && leg < PHASES) {
    const uint32_t pulse_cycles = 2u * ((uint32_t)p->dead_time_cycles + (uint32_t)p->least_on_cycles);
    const int32_t share_q16 = (int32_t)((pulse_cycles << 17) / (3u * v->report.period_cycles));
    pulse_v_q25 = mul_q16(v->report.vdc_v_q25, share_q16);
  }
  pulse(v, leg, pulse_v_q25, 0);
  vector_turn(v, 0, leg < PHASES);
  v->waiting_ticks++;
  return leg >= PHASES;
}

// Voltage that drives a current of so many parts of the rated one to its peak in so many ticks, in the file's machine.
COLD static int32_t pulse_v_q25(const vector_t *v, int32_t parts, int32_t ticks) {
  const parameters_t *p = v->p;
  const int32_t step_v_q25 = gain_apply(p->rated_i_q17 / parts * 256, p->vector_impedance);
  return step_v_q25 / (ticks * p->vector_tick_samples) + (int32_t)(((int64_t)step_v_q25 * p->vector_resistance_q30) >> 30);
}

// Voltage of the wiring's test. What its levels add is lost in the dead time, by short and by long pulses.
COLD static int32_t wiring_v_q25(const vector_t *v) {
  const int32_t first_v_q25 = pulse_v_q25(v, WIRING_SHARE, WIRING_CURRENT_TICKS);
  int32_t current_v_q25 = first_v_q25;
  for (uint32_t level = 0; level < v->wiring.level; level++) {
    current_v_q25 += current_v_q25 / 2;
  }
  if (!v->wiring.captures) {
    return current_v_q25;
  }
  const int32_t short_v_q25 = pulse_v_q25(v, WIRING_VOLTAGE_SHARE, WIRING_VOLTAGE_TICKS) + current_v_q25 - first_v_q25;
  return clamp_i32(current_v_q25, clamp_i32(short_v_q25, 0, v->report.vdc_v_q25 / WIRING_LINK_PART), INT32_MAX);
}

// A tick of the wiring's test.
COLD static outcome_t check_wiring(vector_t *v, const chip_snapshot_t *in) {
  const parameters_t *p = v->p;
  const wiring_verdict_t verdict = wiring_step(&v->wiring, p, in, p->rated_i_q17 / WIRING_SHARE);
  // A tick that reads the capture has no time for more.
  const int32_t voltage_v_q25 = (v->wiring.sign == 0) ? 0 : v->wiring.sign * wiring_v_q25(v);
  pulse(v, v->wiring.leg, voltage_v_q25, in->vector.theta_sample_q32);
  vector_turn(v, 0, verdict == WIRING_TESTING);
  chip_shift_samples(p, wiring_shift_cycles(&v->wiring, (uint32_t)p->sample_period_cycles));
  if (verdict == WIRING_TESTING) {
    return outcome_of(EVENT_STAY);
  }
  v->tests = false;
  if (verdict == WIRING_WRONG) {
    return outcome_fault(FAULT_WIRING);
  }
  return (v->settings->check_wiring == CHECK_WIRING_ONLY) ? outcome_of(EVENT_STOPPED) : vector_begin(v);
}

// Small voltages in place of a frame, which stands still.
COLD static void begin_pulses(vector_t *v, phase_t phase) {
  v->waiting_ticks = 0;
  vector_turn(v, 0, true);
  v->frame = FRAME_CAUGHT;
  v->report.phase = phase;
}

COLD outcome_t vector_begin(vector_t *v) {
  const phase_t done = v->report.phase;
  const bool doubted = PHASES == 3 && v->order->suspected && v->coast.verdict == WINDING_UNKNOWN;
  const bool only = v->settings->check_wiring == CHECK_WIRING_ONLY;
  const bool unproven = PHASES == 3 && (only || (v->settings->check_wiring == CHECK_WIRING_FIRST && !v->wiring.passed));
  if (doubted && done == START_COAST) {
    begin_pulses(v, START_INSULATION);
  } else if (unproven && done != START_WIRING) {
    wiring_begin(&v->wiring);
    v->tests = true;
    begin_pulses(v, START_WIRING);
  } else if (vector_injects(v)) {
    const outcome_t refused = vector_injection_begin(v);
    if (outcome_event(refused) != EVENT_STAY) {
      return refused;
    }
    v->frame = FRAME_INJECTED;
    v->report.phase = START_SEARCH;
  } else {
    begin_forced(v);
  }
  v->report.gates = true;
  current_on(&v->command);
  return outcome_of(EVENT_STAY);
}

COLD outcome_t vector_catch(vector_t *v, uint32_t angle_q32, int32_t mean_step_q32, bool indexed) {
  const parameters_t *p = v->p;
  const int32_t speed_turn_q36 = (mean_step_q32 / (int32_t)v->per_tick.period_cycles) * 16;
  if (abs_sat(speed_turn_q36) < p->vector_handover_turn_q36) {
    return outcome_of(EVENT_STAY);
  }
  // The EMF stands a quarter ahead of the magnet in the direction of rotation. What is set now acts at the next tick.
  const uint32_t quarter = (speed_turn_q36 < 0) ? 0u - QUARTER_TURN : QUARTER_TURN;
  const encoder_proof_t proof = v->sensored ? vector_prove_coasting(v, angle_q32 - quarter, indexed) : ENCODER_RIGHT;
  if (proof != ENCODER_RIGHT) {
    return (proof == ENCODER_WRONG) ? outcome_fault(FAULT_ENCODER) : outcome_of(EVENT_STAY);
  }
  const uint32_t rotor_q32 = v->sensored ? encoder_angle_q32(v) : angle_q32 - quarter;
  vector_turn(v, (int32_t)(rotor_q32 + (uint32_t)mean_step_q32 - v->report.vector.angle_turn_q32), true);
  vector_lead(v, speed_turn_q36);
  const complex_t emf_v_q25 = {0, gain_apply(speed_turn_q36, p->vector_flux)};
  current_preset(&v->command, 0, emf_v_q25);
  v->waiting_ticks = 0;
  v->frame = FRAME_CAUGHT;
  return outcome_of(EVENT_STAY);
}

// The frame goes along; two ticks after it was turned the legs' compares are those of the EMF.
outcome_t vector_caught_step(vector_t *v, const chip_snapshot_t *in) {
  if (v->report.phase == START_INSULATION) {
    return check_insulation(v) ? vector_begin(v) : outcome_of(EVENT_STAY);
  }
  if (v->report.phase == START_WIRING) {
    return check_wiring(v, in);
  }
  if (in->vector.taken) {
    vector_turn(v, 0, true);
    v->waiting_ticks++;
  }
  if (v->waiting_ticks < 2u) {
    return outcome_of(EVENT_STAY);
  }
  const complex_t zero = {0, 0};
  const complex_t emf_v_q25 = {0, gain_apply(v->report.vector.speed_turn_q36, v->p->vector_flux)};
  vector_observe_from(v, zero, emf_v_q25);
  vector_turn(v, 0, false);
  v->frame = FRAME_OBSERVED;
  vector_track_from(v, 0);
  v->report.gates = true;
  current_on(&v->command);
  v->report.catches++;
  v->report.phase = START_HAND_OVER;
  return outcome_of(EVENT_STAY);
}

// The frame goes ahead by `turn`, the regulator is held for a tick at the voltage of now seen from there. What it
// remembers of the error is made anew meanwhile. Returns the current of now, seen from there.
COLD static complex_t turn_frame(vector_t *v, const chip_snapshot_t *in, int32_t turn_q32, complex_t current_i_q25) {
  const complex_t rotation = rotation_q30(turn_q32);
  vector_turn(v, turn_q32, true);
  vector_design_turn(v, rotation);
  current_preset(&v->command, 0, complex_mul_q30(in->vector.u_v_q25[0], rotation));
  return complex_mul_q30(current_i_q25, rotation);
}

COLD static complex_t hand_over(vector_t *v, const chip_snapshot_t *in) {
  const complex_t reference_i_q25 = turn_frame(v, in, v->start.turn_q32, (complex_t){v->start.current_i_q25, v->start.damping_i_q25});
  v->frame = FRAME_OBSERVED;
  // The rotor swings in the forced frame: its speed is that of the frame and of the swing. From the turns in the two
  // halves of the steady time, h ticks each: (3 second - first) / 2h at its end, (second - first) / h^2 more a tick. By the
  // encoder the frame is handed over at rest, without a steady time.
  const int32_t half = (int32_t)v->start.steady_ticks / 2;
  int32_t change_q32 = 0;
  if (half > 0) {
    const int32_t first_q32 = (int32_t)((uint32_t)v->start.turn_middle_q32 - (uint32_t)v->start.turn_from_q32);
    const int32_t second_q32 = (int32_t)((uint32_t)v->start.turn_q32 - (uint32_t)v->start.turn_middle_q32);
    const int32_t cycles = half * (int32_t)v->per_tick.period_cycles;
    vector_lead(v, v->report.vector.speed_turn_q36 + ((second_q32 + (second_q32 - first_q32) / 2) / cycles) * 16);
    change_q32 = (second_q32 - first_q32) / (half * half);
  }
  vector_track_from(v, change_q32);
  v->report.phase = START_HAND_OVER;
  return reference_i_q25;
}

// The current lies on d again: of the same length, so that nothing jumps.
COLD complex_t vector_hand_back(vector_t *v, const chip_snapshot_t *in) {
  const complex_t current = v->reference_i_q25;
  const complex_t reference_i_q25 = turn_frame(v, in, if_turn_back_q32(current), current);
  const int32_t speed_turn_q36 = v->report.vector.speed_turn_q36;
  if_resume(&v->start, &v->start_settings, speed_turn_q36, complex_abs(current), gain_apply(speed_turn_q36, v->p->vector_flux));
  v->waiting_ticks = 0;
  v->slip_checks = 0;
  v->frame = FRAME_FORCED;
  v->report.phase = START_RAMP;
  return reference_i_q25;
}

// The rotor that the forced frame leads, by its EMF e^ and that of the frame's speed, E: it follows while e^_q > 0.3 E, and
// |e^| is its speed then. An EMF that the observer's error may be tells nothing. True: it has not followed for 30 ms and a
// quarter turn of the frame.
COLD static bool slips(vector_t *v) {
  const int32_t speed_turn_q36 = v->report.vector.speed_turn_q36;
  const complex_t emf_v_q25 = v->observer.emf_v_q25;
  const uint32_t due_v_q25 = (uint32_t)abs_sat(gain_apply(speed_turn_q36, v->p->vector_flux));
  const uint32_t wrong_v_q25 =
      (uint32_t)gain_apply(v->start.current_i_q25, v->lost.resistance) + v->lost.floor_v_q25;
  const uint32_t amplitude_v_q25 = complex_abs(emf_v_q25);
  const bool follows = ((speed_turn_q36 < 0) ? -emf_v_q25.im : emf_v_q25.im) > (int32_t)(due_v_q25 / 10u * 3u);
  const int32_t frame_rpm_q8 = rpm_q8(v, speed_turn_q36);
  const int32_t smooth_v_q25 = (speed_turn_q36 < 0) ? -v->start.emf_v_q25.im : v->start.emf_v_q25.im;
  v->start.share_q16 = (v->sensored || due_v_q25 < wrong_v_q25) ? IF_WHOLE_Q16 : if_share_q16(smooth_v_q25, due_v_q25);
  const bool known = follows && amplitude_v_q25 >= wrong_v_q25;
  const uint64_t product = (uint64_t)(uint32_t)abs_sat(frame_rpm_q8) * amplitude_v_q25;
  const int32_t speed_rpm_q8 = known ? (int32_t)div_sat_u32(product, due_v_q25) : 0;
  tell_speed(v, (frame_rpm_q8 < 0) ? -speed_rpm_q8 : speed_rpm_q8, known);
  if (follows || due_v_q25 < wrong_v_q25) {
    v->slip_checks = 0;
    v->slip_turn_q32 = 0;
    return false;
  }
  v->slip_checks++;
  if (v->slip_turn_q32 < QUARTER_TURN) {
    const uint64_t turn_q36 = (uint64_t)(uint32_t)abs_sat(speed_turn_q36) * v->per_tick.period_cycles * VECTOR_GROUPS;
    v->slip_turn_q32 += (uint32_t)(turn_q36 >> 4);
  }
  return v->slip_checks > v->lost.most / 4u * SLIP_FIVE_MS && v->slip_turn_q32 >= QUARTER_TURN;
}

// The rotor that is aligned goes over to the encoder, once that is not wrong.
COLD static outcome_t lead_encoder(vector_t *v, const chip_snapshot_t *in, complex_t *reference_i_q25) {
  const encoder_proof_t proof = vector_prove_encoder(v);
  if (proof == ENCODER_WRONG) {
    return outcome_fault(FAULT_ENCODER);
  }
  if (proof == ENCODER_RIGHT) {
    v->start.turn_q32 = (int32_t)(encoder_angle_q32(v) - v->frame_turn_q32);
    v->start.steady_ticks = 0;
    *reference_i_q25 = hand_over(v, in);
  }
  return outcome_of(EVENT_STAY);
}

HOT outcome_t vector_forced_step(vector_t *v, const chip_snapshot_t *in, complex_t *reference_i_q25) {
  const parameters_t *p = v->p;
  const bool stopping = v->order->state == STATE_STOPPING;
  const int32_t target = (v->settings->target_rpm < 0) ? -p->vector_handover_turn_q36 : p->vector_handover_turn_q36;
  const bool there = if_step(&v->start, &v->start_settings, stopping ? 0 : target);
  vector_lead(v, if_speed_turn_q36(&v->start));
  const int32_t due_v_q25 = gain_apply(v->report.vector.speed_turn_q36, p->vector_flux);
  *reference_i_q25 = if_current_i_q25(&v->start, &v->start_settings, v->observer.emf_v_q25, due_v_q25);
  if (v->order->tick % VECTOR_GROUPS == GROUP_SUPERVISION && slips(v)) {
    return stopping ? outcome_of(EVENT_STOPPED) : outcome_because(EVENT_START_FAILED, FAULT_STALLED);
  }
  if (v->report.phase == START_ALIGN) {
    if (v->encoder) {
      vector_watch_alignment(v);
    }
    if (v->start.aligned_ticks >= v->start_settings.align_ticks) {
      v->report.phase = START_RAMP;
      if (v->encoder) {
        vector_learn_mounting(v, &in->vector);
      }
    }
  }
  if (v->sensored) {
    return (v->report.phase == START_RAMP) ? lead_encoder(v, in, reference_i_q25) : outcome_of(EVENT_STAY);
  }
  if (!there) {
    v->waiting_ticks = 0;
    return outcome_of(EVENT_STAY);
  }
  if (stopping) {
    return outcome_of(EVENT_STOPPED);
  }
  if (if_ready(&v->start, &v->start_settings)) {
    *reference_i_q25 = hand_over(v, in);
    return outcome_of(EVENT_STAY);
  }
  v->waiting_ticks++;
  const bool late = v->waiting_ticks > (uint32_t)p->lock_timeout_ticks + v->start_settings.steady_ticks;
  return outcome_of(late ? EVENT_START_FAILED : EVENT_STAY);
}
