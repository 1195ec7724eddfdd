// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "drive/vector/vector.h"

#include "control/balance.h"
#include "control/brake.h"
#include "control/fixed.h"
#include "control/mtpa.h"
#include "control/placement.h"
#include "control/speed.h"
#include "control/trig.h"
#include "control/vector_speed.h"
#include "drive/vector/current.h"
#include "drive/vector/parts.h"

#define ONE_OVER_SQRT3_Q16 37837
// Share of the circle that subspace 3 may have.
#define THIRD_SHARE_SHIFT 2
#define REST_PARTS 64
#define ONE_Q16 65536
#define SOFTEST 32
#define SPEED_SCALE_MIN_Q16 (ONE_Q16 / 16)
// The field weakening leaves 0.95 of the largest voltage.
#define WEAKENING_SHARE_Q16 62259

static int32_t current_limit_i_q25(const vector_t *v) { return v->settings->current_limit_q17 * 256; }

// The target asks for the other direction, or for none.
HOT static bool descending(const vector_t *v, const order_t *order, const settings_t *settings) {
  return order->state == STATE_STOPPING || (settings->target_rpm < 0 && v->direction > 0) ||
         (settings->target_rpm > 0 && v->direction < 0);
}

HOT static int32_t share(int32_t sum, int32_t share_q30) {
  return (int32_t)(((int64_t)sum * share_q30 + ONE_Q30 / 2) >> 30);
}

// Only what the step before asked for. Ticks that follow the samples cannot miss them.
HOT static void measure_link(vector_t *v, const chip_snapshot_t *in) {
  vector_measured_t *m = &v->m;
  report_t *report = &v->report;
  v->report.vector.angle_turn_q32 = in->vector.theta_sample_q32;
  report->silent_ticks = (in->sample_number == m->last_sample) ? report->silent_ticks + 1u : 0u;
  m->last_sample = in->sample_number;
  if (in->sum_count > 0u) {
    const int32_t share_q30 = vector_share_of(&v->sums, in->sum_count);
    report->vdc_v_q25 = clamp_i32(share(in->vdc_sum_q17, share_q30), 0, SAMPLE_MAX_Q17) * 256;
    const int32_t idc_q17 = clamp_i32(share(in->idc_sum_q17, share_q30), -FULL_Q17, SAMPLE_MAX_Q17);
    report->idc_mean_q17 = idc_q17;
    m->idc_filter_q25 += (idc_q17 * 256 - m->idc_filter_q25) >> CURRENT_FILTER_SHIFT;
    report->idc_q17 = m->idc_filter_q25 >> 8;
  }
}

// What i_d leaves of the limit, made anew when i_d has moved by a part of it.
HOT static int32_t current_rest(vector_t *v, int32_t limit_i_q25) {
  const int32_t d_i_q25 = v->reference_i_q25.re;
  if (d_i_q25 == 0) {
    return limit_i_q25;
  }
  if (limit_i_q25 != v->rest.limit_i_q25 || abs_sat(d_i_q25 - v->rest.d_i_q25) > limit_i_q25 / REST_PARTS) {
    v->rest = (current_rest_t){limit_i_q25, d_i_q25, current_rest_i_q25(limit_i_q25, d_i_q25)};
  }
  return v->rest.rest_i_q25;
}

// At a share of the bandwidth.
COLD static pi_gains_t slower_gains(const pi_gains_t *whole, int32_t wanted_share_q16) {
  const int32_t share_q16 = clamp_i32(wanted_share_q16, SPEED_SCALE_MIN_Q16, ONE_Q16);
  return (pi_gains_t){{mul_q16(whole->kp.mant, share_q16), whole->kp.shift},
                      {mul_q16(mul_q16(whole->ki.mant, share_q16), share_q16), whole->ki.shift}};
}

// The speed whose bandwidth the regulator has at a wanted speed: beyond a sixteenth of error up to three times as much.
COLD static int32_t hurried(int32_t wanted_turn_q36, int32_t error_turn_q36) {
  const int32_t most = clamp_i32(wanted_turn_q36, 0, INT32_MAX / 4);
  const int32_t excess = clamp_i32(abs_sat(error_turn_q36) - most / 16, 0, most / 8);
  return most + 16 * excess;
}

// The current that accelerates the rotor alone goes ahead of the regulator while the ramp goes up or down.
INLINED static void speed_regulator(vector_t *v, bool limited, int32_t direction, int32_t ahead_i_q25) {
  const int32_t limit = current_limit_i_q25(v);
  const int32_t rest = current_rest(v, limit);
  int32_t driving = rest;
  if (limited) {
    // A voltage at its limit cannot drive more current than flows.
    const int32_t reached = abs_sat(v->report.vector.current_i_q17.im) * 256 + limit / 8;
    driving = (reached < rest) ? reached : rest;
  }
  // Near standstill braking feeds nothing back.
  const bool crawling = v->sensored && v->report.vector.speed_turn_q36 * v->direction < v->p->vector_back_turn_q36;
  const int32_t braking = (v->brake_i_q25 < rest && !crawling) ? v->brake_i_q25 : rest;
  const int32_t high = (v->direction > 0) ? driving : braking;
  const int32_t low = (v->direction > 0) ? -braking : -driving;
  const int32_t wanted = gain_apply(v->ramp.value_rpm_q8, v->p->vector_rpm_to_turn);
  int32_t ahead = 0;
  if (direction != 0) {
    const int32_t most = (v->ahead_most_i_q25 < rest) ? v->ahead_most_i_q25 : rest;
    ahead = direction * clamp_i32(ahead_i_q25, 0, most);
  }
  // It comes in after a hand-over as slowly as other currents go.
  if (__builtin_expect(v->ahead_most_i_q25 < limit, 0)) {
    v->ahead_most_i_q25 += (int32_t)VECTOR_GROUPS * v->p->vector_fade_i_q25;
  }
  int32_t error = wanted - v->report.vector.speed_turn_q36;
  const pi_gains_t *gains = &v->speed_gains;
  pi_gains_t slower;
  if (!v->sensored && v->report.vector.speed_turn_q36 * v->direction < v->p->vector_ripple_most_turn_q36) {
    error = ripple_step(&v->ripple, error, v->report.vector.speed_turn_q36, v->p->tick_cycles * (int32_t)VECTOR_GROUPS,
                        (uint32_t)v->p->vector_harmonics);
    // Slower than what the EMF's harmonics are at, unless a load takes the speed away.
    if (__builtin_expect(wanted * v->direction < v->p->vector_whole_turn_q36, 0)) {
      slower = slower_gains(gains, gain_apply(hurried(wanted * v->direction, error), v->p->vector_speed_scale));
      gains = &slower;
    }
  }
  const pi_result_t i = vector_speed_between(&v->speed, gains, error, ahead, low, high);
  v->report.limit = limited ? LIMIT_DUTY_MAX : ((i.output != i.unlimited) ? LIMIT_CURRENT : LIMIT_NONE);
  v->reference_i_q25.im = i.output;
  if (v->p->vector_mtpa_ratio_i_q25 != 0) {
    const complex_t split = mtpa_current_i_q25(i.output, v->p->vector_mtpa_ratio_i_q25);
    v->mtpa_i_q25 = split.re;
    v->reference_i_q25.im = split.im;
  }
}

HOT static void weaken_field(vector_t *v, complex_t voltage_v_q25) {
  const parameters_t *p = v->p;
  const int32_t limit_v_q25 = (int32_t)v->command.limits.v_q17[0] * 256;
  const field_weakening_settings_t settings = {
      .ki = v->weakening_ki,
      .wanted_v_q25 = mul_q16(limit_v_q25, WEAKENING_SHARE_Q16),
      .lowest_i_q25 = p->vector_weakening_lowest_i_q25,
  };
  const int32_t highest = v->mtpa_i_q25;
  (void)field_weakening_step(&v->weakening, &settings, voltage_v_q25,
                             (highest > settings.lowest_i_q25) ? highest : settings.lowest_i_q25);
}

// Where the supply takes nothing back a small link reaches its trip before its voltage can limit the current: there the
// braking power has a limit of its own.
HOT static int32_t brake_limit_i_q25(const vector_t *v) {
  const int32_t limit_i_q25 = v->settings->brake_limit_i_q25;
  const uint32_t power = (uint32_t)v->p->vector_brake_power;
  if (power == 0u) {
    return limit_i_q25;
  }
  const uint32_t most_i_q17 = power / ((uint32_t)abs_sat(v->report.vector.speed_turn_q36) / 256u + 1u);
  return (most_i_q17 < (uint32_t)limit_i_q25 / 256u) ? (int32_t)most_i_q17 * 256 : limit_i_q25;
}

// Voltage circle and the modulator's scale for the DC link of now, braking current.
HOT static void apply_limits(vector_t *v) {
  const parameters_t *p = v->p;
  const int32_t vdc = v->report.vdc_v_q25;
  const int32_t circle_v_q25 = mul_q16(mul_q16(vdc, ONE_OVER_SQRT3_Q16), p->vector_circle_q16);
  const uint32_t circle_v_q17 = (uint32_t)clamp_i32(circle_v_q25 >> 8, 0, SAMPLE_MAX_Q17);
  v->brake_i_q25 = brake_current(v->brake_i_q25, brake_limit_i_q25(v), vdc, p->brake_vdc_v_q25, p->brake_range);
  const int32_t lead_q32 = vector_injects(v)
                               ? v->injection->command.lead_q32
                               : vector_lead_turn_q32(&v->plant.machine, v->report.vector.speed_turn_q36);
  const uint32_t first_v_q17 = vector_injects(v) ? vector_injection_circle(v, circle_v_q17) : circle_v_q17;
  current_limits(&v->command, first_v_q17, circle_v_q17 >> THIRD_SHARE_SHIFT, lead_q32, p->vector_scale_v, vdc);
  if (__builtin_expect(v->shaped, 0)) {
    emf_shape_follow(&v->shape, &p->vector_shape, v->observer.emf_v_q25.im, v->report.vector.speed_turn_q36,
                     circle_v_q25 - (int32_t)rough_length(v->state_v_q25), p->tick_cycles);
  }
}

// Observed and encoder angle side by side.
HOT static void compare_angles(vector_t *v, const chip_vector_snapshot_t *in) {
  v->report.vector.observed_ahead_q30 = v->sensored ? pll_error_q30(v->observer.emf_v_q25, v->report.vector.speed_turn_q36,
                                                      v->start_settings.minimum_v_q25)
                                      : v->error_q30;
  vector_compare_encoder(v, in);
}

// Gates are off when the trip is seen: what the ticks before it have found.
COLD static void doubt_angle(vector_t *v) {
  const bool followed = v->frame == FRAME_OBSERVED && v->order->state == STATE_RUNNING;
  v->report.doubtful = followed && (v->suspicion > 0u || abs_sat(v->error_q30) > LOST_ERROR_Q30);
}

// Does the EMF still belong to the angle and the speed? The cause stands in the log, whatever the restart comes to.
HOT static outcome_t check_lock(vector_t *v, const chip_vector_snapshot_t *in) {
  static const uint8_t causes[] = {[ANGLE_CONTRADICTED] = FAULT_ANGLE_LOST,
                                   [ANGLE_STALLED] = FAULT_STALLED,
                                   [ANGLE_OVERHAULED] = FAULT_OVERHAULED};
  const int32_t speed_turn_q36 = v->report.vector.speed_turn_q36 * v->direction;
  const uint32_t expected_v_q25 = (uint32_t)abs_sat(gain_apply(speed_turn_q36, v->p->vector_flux));
  const uint32_t amplitude_v_q25 = vector_emf_amplitude(v);
  vector_design_state(v, in->u_v_q25[0]);
  if (v->sensored) {
    return vector_judge_encoder(v, expected_v_q25, in);
  }
  const lost_angle_input_t seen = {.emf_v_q25 = v->observer.emf_v_q25,
                                   .amplitude_v_q25 = amplitude_v_q25,
                                   .expected_v_q25 = expected_v_q25,
                                   .current_i_q17 = v->report.vector.current_i_q17,
                                   .error_q30 = v->error_q30,
                                   .speed_turn_q36 = speed_turn_q36,
                                   .backward = v->report.vector.speed_turn_q36 < 0};
  const angle_verdict_t verdict = lost_angle_step(&v->suspicion, &v->lost, &seen);
  if (__builtin_expect(verdict == ANGLE_HELD, 1)) {
    return outcome_of(EVENT_STAY);
  }
  return outcome_because(EVENT_LOCK_LOST, (fault_t)causes[verdict]);
}

// At a low target the regulator is slower, and so is the end of the ramp.
COLD static void renew_slope(vector_t *v, int32_t step_rpm_q20, int32_t target_rpm_q8) {
  const parameters_t *p = v->p;
  const int32_t wanted_share_q16 =
      gain_apply(gain_apply(abs_sat(target_rpm_q8), p->vector_rpm_to_turn), p->vector_speed_scale);
  const int32_t share_q16 = clamp_i32(wanted_share_q16, SPEED_SCALE_MIN_Q16, ONE_Q16);
  const uint64_t soft_q16 = (uint64_t)(uint32_t)gain_apply(step_rpm_q20, p->vector_soft) << 16;
  v->slope = (slope_t){step_rpm_q20, target_rpm_q8, gain_apply(step_rpm_q20, p->vector_accel),
                       sat_i32((int64_t)div_u64(soft_q16, (uint32_t)share_q16)),
                       {mul_q16(p->vector_approach.mant, share_q16), p->vector_approach.shift}};
}

// The ramp slows down before its end, no faster than the regulator can follow.
INLINED static void follow_ramp(vector_t *v, const chip_snapshot_t *in, const settings_t *settings, int32_t target_rpm_q8) {
  const parameters_t *p = v->p;
  const int32_t step_rpm_q20 = clamp_i32(settings->accel_rpm_q20, 1, INT32_MAX / (int32_t)VECTOR_GROUPS);
  if (__builtin_expect(step_rpm_q20 != v->slope.step_rpm_q20 || target_rpm_q8 != v->slope.target_rpm_q8, 0)) {
    renew_slope(v, step_rpm_q20, target_rpm_q8);
  }
  const int32_t left_rpm_q8 = abs_sat(target_rpm_q8 - v->ramp.value_rpm_q8);
  int32_t now_rpm_q20 = step_rpm_q20;
  int32_t ahead_i_q25 = v->slope.ahead_i_q25;
  if (__builtin_expect(left_rpm_q8 < v->slope.soft_rpm_q8 && left_rpm_q8 != 0 && !v->sensored && !settings->line, 0)) {
    now_rpm_q20 = clamp_i32(gain_apply(left_rpm_q8, v->slope.approach), step_rpm_q20 / SOFTEST + 1, step_rpm_q20);
    ahead_i_q25 = gain_apply(now_rpm_q20, p->vector_accel);
  }
  tell_speed(v, rpm_q8(v, v->report.vector.speed_turn_q36), true);
  const int32_t moving = ramp_step(&v->ramp, target_rpm_q8, now_rpm_q20 * (int32_t)VECTOR_GROUPS,
                                   v->report.speed_rpm_q8, p->ramp_window_rpm * 256);
  speed_regulator(v, in->vector.limited[0], moving, ahead_i_q25);
}

// Speed, its reference, the reference of i_q and the goal of i_d.
HOT static outcome_t regulate_speed(vector_t *v, const chip_snapshot_t *in, const order_t *order,
                                  const settings_t *settings) {
  const parameters_t *p = v->p;
  const bool down = descending(v, order, settings);
  const int32_t target_rpm_q8 =
      clamp_i32(abs_sat(settings->target_rpm) * 256, v->least_rpm_q8, p->speed_max_rpm * 256);
  follow_ramp(v, in, settings, v->direction * (down ? v->back_rpm_q8 : target_rpm_q8));
  const int32_t speed_rpm_q8 = v->direction * v->report.speed_rpm_q8;
  const bool slow = down && speed_rpm_q8 < v->handover_rpm_q8;
  v->goal_i_q25 = slow ? p->vector_start.current_i_q25 : v->weakening.current_i_q30 >> 5;
  // An estimate in doubt gets the name of what is wrong with it, 5 ms later at most.
  if (speed_rpm_q8 / 256 > p->overspeed_rpm && v->suspicion == 0u &&
      abs_sat(v->error_q30) < LOST_ERROR_Q30) {
    return outcome_fault(FAULT_OVERSPEED);
  }
  if (slow && v->reference_i_q25.re == v->goal_i_q25 && speed_rpm_q8 <= v->back_rpm_q8 + v->back_rpm_q8 / 16) {
    v->reference_i_q25 = vector_hand_back(v, in);
    return outcome_of(EVENT_HANDED_BACK);
  }
  return outcome_of(EVENT_STAY);
}

// With an encoder: the target's sign is taken through zero, zero is a target.
SHARED static outcome_t regulate_sensored(vector_t *v, const chip_snapshot_t *in, const order_t *order,
                                  const settings_t *settings) {
  const parameters_t *p = v->p;
  const bool stopping = order->state == STATE_STOPPING;
  v->direction = (v->report.vector.speed_turn_q36 < 0) ? -1 : 1;
  follow_ramp(v, in, settings, stopping ? 0 : settings->target_rpm * 256);
  v->goal_i_q25 = v->weakening.current_i_q30 >> 5;
  const int32_t speed_rpm_q8 = abs_sat(v->report.speed_rpm_q8);
  if (speed_rpm_q8 / 256 > p->overspeed_rpm) {
    return outcome_fault(FAULT_OVERSPEED);
  }
  const bool stopped = stopping && v->ramp.value_rpm_q8 == 0 && speed_rpm_q8 < v->back_rpm_q8 / 16;
  return outcome_of(stopped ? EVENT_STOPPED : EVENT_STAY);
}

HOT static outcome_t observed_step(vector_t *v, const chip_snapshot_t *in, const order_t *order,
                                  const settings_t *settings) {
  const parameters_t *p = v->p;
  outcome_t outcome = outcome_of(EVENT_STAY);
  vector_track(v, in->vector.taken);
  v->reference_i_q25.re = fade(v->reference_i_q25.re, v->goal_i_q25, p->vector_fade_i_q25);
  switch (vector_turn_tick(v, order) % VECTOR_GROUPS) {
    case GROUP_SPEED:
      outcome = v->sensored ? regulate_sensored(v, in, order, settings) : regulate_speed(v, in, order, settings);
      break;
    case GROUP_FIELD:
      if (p->vector_weakening_lowest_i_q25 < 0) {
        weaken_field(v, in->vector.u_v_q25[0]);
      } else {
        v->weakening.current_i_q30 = v->mtpa_i_q25 * 32;
      }
      break;
    case GROUP_SUPERVISION:
      outcome = check_lock(v, &in->vector);
      compare_angles(v, &in->vector);
      break;
    default:
      break;
  }
  const bool started = outcome_event(outcome) == EVENT_STAY && order->state == STATE_STARTING;
  return started ? outcome_of(EVENT_STARTED) : outcome;
}

HOT complex_t vector_want(vector_t *v, complex_t current_i_q17) {
  const direct_set_t *set = &v->direct[v->direct_used];
  const complex_t wanted = complex_regulator_want(&v->regulator, &set->gains, set->reference_i_q17, current_i_q17);
  return set->regulate ? wanted : set->preset_v_q25;
}

HOT void vector_bound(vector_t *v, complex_t wanted_v_q25) {
  const direct_set_t *set = &v->direct[v->direct_used];
  (void)complex_regulator_bound(&v->regulator, &set->gains, wanted_v_q25, set->limit_v_q17);
  if (!set->regulate) {
    v->regulator.carry_v_q25 = (complex_t){0, 0};
  }
}

// The frame is the rotor's from now on: everything begins at its speed and at the current that flows.
COLD static void take_over(vector_t *v) {
  const int32_t speed_turn_q36 = v->report.vector.speed_turn_q36;
  v->direction = (speed_turn_q36 < 0) ? -1 : 1;
  v->suspicion = 0;
  v->goal_i_q25 = v->reference_i_q25.re;
  v->brake_i_q25 = v->settings->brake_limit_i_q25;
  ramp_preset(&v->ramp, rpm_q8(v, speed_turn_q36));
  vector_speed_preset(&v->speed, &v->speed_gains, speed_turn_q36, speed_turn_q36, v->reference_i_q25.im);
}

COLD static outcome_t caught_step(vector_t *v, const chip_snapshot_t *in) {
  const outcome_t outcome = vector_caught_step(v, in);
  if (v->frame == FRAME_OBSERVED) {
    take_over(v);
  }
  return outcome;
}

SHARED static outcome_t forced_step(vector_t *v, const chip_snapshot_t *in) {
  const outcome_t outcome = vector_forced_step(v, in, &v->reference_i_q25);
  if (v->frame == FRAME_OBSERVED) {
    v->ahead_most_i_q25 = 0;
    take_over(v);
  } else {
    v->ramp.value_rpm_q8 = rpm_q8(v, v->report.vector.speed_turn_q36);
  }
  return outcome;
}

INLINED static outcome_t injected_step(vector_t *v, const chip_snapshot_t *in) {
  const outcome_t outcome = vector_injection_step(v, in);
  v->reference_i_q25 = v->injection->command.reference_i_q25[0];
  v->report.limit = v->injection->frame.limited ? LIMIT_CURRENT : LIMIT_NONE;
  return outcome;
}

// What is committed in this step, for the regulator in C.
SHARED static void stage_direct(vector_t *v, const vector_command_t *c) {
  const complex_t preset_v_q25 = {c->control.preset_v_q17[0].re * 256, c->control.preset_v_q17[0].im * 256};
  v->direct[1u - v->direct_used] = (direct_set_t){v->design[v->used].regulator, c->reference.i_q17[0], preset_v_q25,
                                                  (int32_t)c->limits.v_q17[0], c->control.regulate[0]};
}

// The EMF's harmonics go forward, and the current is smaller where the EMF is larger: the torque stays.
SHARED static complex_t shaped_reference_i_q25(vector_t *v) {
  complex_t reference_i_q25 = v->reference_i_q25;
  complex_t voltage_v_q17 = {0, 0};
  if (v->frame == FRAME_OBSERVED && v->shape.emf_v_q25 != 0) {
    const complex_t share_q24 = emf_shape_q24(&v->shape, &v->p->vector_shape, v->frame_turn_q32);
    voltage_v_q17.re = mul_high_i32(v->shape.emf_v_q25, share_q24.re);
    voltage_v_q17.im = mul_high_i32(v->shape.emf_v_q25, share_q24.im);
    reference_i_q25.im -= mul_high_i32(reference_i_q25.im, share_q24.im) * 256;
  }
  current_forward(&v->command, 0, voltage_v_q17);
  return reference_i_q25;
}

HOT static void command_frame(vector_t *v, const order_t *order) {
  const bool regulate = v->frame != FRAME_OFF && !v->holding;
  complex_t reference_i_q17 = to_q17(v->reference_i_q25);
  if (__builtin_expect(v->shaped, 0)) {
    const bool followed = v->frame == FRAME_OBSERVED && order->state == STATE_RUNNING;
    const bool stays = followed && (order->tick & v->shape.rests_mask) != 0u;
    reference_i_q17 = stays ? v->command.reference.i_q17[0] : to_q17(shaped_reference_i_q25(v));
  }
  current_frame(&v->command, v->report.vector.speed_turn_q36, v->correct_q32, reference_i_q17, regulate,
                v->frame == FRAME_OFF || order->state == STATE_STARTING);
  if (__builtin_expect(vector_frame_is_injected(v), 0)) {
    vector_injection_command(v);
  }
}

// Gates off until the rotor is slow enough, or is caught.
COLD static outcome_t coast_step(vector_t *v, const chip_snapshot_t *in) {
  const parameters_t *p = v->p;
  const order_t *order = v->order;
  coast_t *c = &v->coast;
  coast_see(c, p, in);
  const winding_verdict_t winding = coast_winding(c, order);
  if (winding != WINDING_WHOLE) {
    return (winding == WINDING_SHORTED) ? outcome_fault(FAULT_SHORTED_WINDING) : outcome_of(EVENT_STAY);
  }
  const bool caught = order->state_ticks > COAST_SETTLE_TICKS &&
                      coast_caught(c, p, order, v->settings, v->report.vdc_v_q25);
  tell_speed(v, (c->mean_step_q32 < 0) ? -c->speed_rpm_q8 : c->speed_rpm_q8, caught);
  if (caught) {
    const outcome_t outcome = vector_catch(v, c->rotor.angle, c->mean_step_q32, v->encoder && in->vector.encoder_indexed);
    if (outcome != 0u || v->frame == FRAME_CAUGHT) {
      return outcome;
    }
  }
  if (coast_stuck(c, p, in)) {
    return outcome_fault(FAULT_VOLTAGE_CHANNEL);
  }
  switch (coast_judge(c, p, order, coast_calm(c, p, order), v->report.vdc_v_q25)) {
    case COAST_AT_REST:
      return vector_begin(v);
    case COAST_FAULT:
      return outcome_fault(c->fault);
    case COAST_WAIT:
    default:
      return outcome_of(EVENT_STAY);
  }
}

COLD void vector_off(vector_t *v) {
  vector_frame_off(v);
  v->reference_i_q25 = (complex_t){0, 0};
  v->report.limit = LIMIT_NONE;
}

COLD void vector_init(vector_t *v, const parameters_t *p, const order_t *order, const settings_t *settings) {
  __builtin_memset(v, 0, sizeof *v);
  v->p = p;
  v->order = order;
  v->settings = settings;
  v->speed_numerator_q8 = speed_numerator_q8((uint32_t)p->clock_hz, (uint32_t)p->pole_pairs);
  v->pll_gains = p->vector_pll;
  if (p->injection != 0 && (HELD & HELD_INJECTION) != 0) {
    const vector_machine_t machine = vector_machine(p);
    vector_injection_init(v, &machine);
  }
  vector_constants(v);
  current_look(&v->command, true, false, true);
  current_look_at_angle(&v->command, v->encoder || v->shaped);
  vector_frame_off(v);
  vector_first_design(v);
  v->report.period_cycles = (uint32_t)p->carrier_longest_cycles;
  static const int32_t no_sectors[SECTORS];
  v->report.six_step.threshold_q17 = no_sectors;
  v->report.six_step.hall_late_q20 = no_sectors;
  v->report.vector.injects = vector_injects(v);
  v->report.wiring = &v->wiring;
}

COLD void vector_start(vector_t *v, const order_t *order, const settings_t *settings) {
  (void)order;
  (void)settings;
  coast_begin(&v->coast);
  v->weakening.current_i_q30 = 0;
  v->mtpa_i_q25 = 0;
  vector_frame_coast(v);
}

bool vector_explains(const vector_t *v, const chip_snapshot_t *in, const order_t *order) {
  (void)v;
  (void)in;
  (void)order;
  return false;
}

INLINED bool vector_measure(vector_t *v, const chip_snapshot_t *in, const order_t *order, const settings_t *settings) {
  (void)settings;
  if ((HELD & HELD_INJECTION) != 0) {
    v->late = vector_injects(v) && !in->vector.taken;
  }
  if (__builtin_expect(v->on_core, 0) && in->vector.taken) {
    v->direct_used = 1u - v->direct_used;
  }
  if (__builtin_expect(v->finished, 0) && !v->design_waits) {
    vector_take_design(v);
  }
  v->whole = v->command.look.slow || order->state != STATE_RUNNING || vector_injects(v);
  if (v->command.look.slow) {
    measure_link(v, in);
    if (vector_turn_tick(v, order) % VECTOR_LOOK_TICKS == GROUP_SUPERVISION) {
      v->report.machine_i_q17 = (int32_t)rough_length(in->vector.i_q17[0]);
    }
  }
  v->report.vector.current_i_q17 = in->vector.i_q17[0];
  if (__builtin_expect(v->command.look.angle, 0)) {
    v->frame_turn_q32 = in->vector.theta_sample_q32;
    if (v->encoder) {
      vector_read_encoder(v, &in->vector);
    }
  }
  if (__builtin_expect(v->frame == FRAME_OFF, 0) || vector_turn_tick(v, order) % VECTOR_GROUPS == GROUP_LIMITS) {
    apply_limits(v);
  }
  // Nothing else of what supervision looks at moves here.
  const bool look = in->trip_latched != 0u || v->report.silent_ticks > 0u;
  if (__builtin_expect(look, 0)) {
    doubt_angle(v);
  }
  return look;
}

INLINED outcome_t vector_step(vector_t *v, const chip_snapshot_t *in, const order_t *order, const settings_t *settings) {
  if (v->frame == FRAME_OFF) {
    return (order->state == STATE_STARTING) ? coast_step(v, in) : outcome_of(EVENT_STAY);
  }
  if (v->frame == FRAME_CAUGHT) {
    return caught_step(v, in);
  }
  if (vector_frame_is_injected(v)) {
    return injected_step(v, in);
  }
  v->frame_turn_q32 += (uint32_t)vector_observe(v, &in->vector);
  return (v->frame == FRAME_FORCED) ? forced_step(v, in) : observed_step(v, in, order, settings);
}

INLINED void vector_finish(vector_t *v, const order_t *order) {
  vector_command_t *c = &v->command;
  if ((HELD & HELD_INJECTION) != 0) {
    v->late_ticks += v->late ? 1u : 0u;
  }
  const uint32_t next = (vector_turn_tick(v, order) + 1u) % VECTOR_GROUPS;
  const bool listens = vector_frame_is_injected(v) && vector_open_phase_listens(v);
  const bool tests = __builtin_expect(v->tests || listens, 0);
  const bool slow = v->frame == FRAME_OFF || next == GROUP_SUPERVISION || tests;
  const bool due = vector_injects(v) || (vector_turn_tick(v, order) + 1u) % VECTOR_LOOK_TICKS == GROUP_SUPERVISION;
  const bool currents = slow && (tests || due);
  current_look(c, slow, currents, v->several || slow || next == GROUP_SPEED);
  if (__builtin_expect(order->state != STATE_RUNNING || order->state_ticks == 0u, 0)) {
    current_tick(c, order->state != STATE_INIT && order->state != STATE_FAULT);
  }
  command_frame(v, order);
  if (__builtin_expect(v->on_core, 0)) {
    stage_direct(v, c);
  }
  if (v->whole || order->state != STATE_RUNNING) {
    v->report.demand_rpm_q8 = v->ramp.value_rpm_q8;
    v->report.current_i_q25 = v->report.vector.current_i_q17.im * 256;
    if (vector_injects(v)) {
      vector_injection_report(v);
      const bool observed = v->frame == FRAME_CAUGHT || v->frame == FRAME_OBSERVED;
      v->report.demand_rpm_q8 = observed ? v->ramp.value_rpm_q8 : v->injection->ramp.value_rpm_q8;
    }
  }
}
