// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "drive/six_step/regulate.h"

#include "control/advance.h"
#include "control/brake.h"
#include "control/carrier.h"
#include "control/line_current.h"
#include "control/placement.h"
#include "control/torque.h"

#define ONE_Q16 65536
// The least duty grows with speed; at most this.
#define LEAST_DUTY_MAX_Q16 26214
// Least share of the gains at low speed.
#define BANDWIDTH_SCALE_MIN_Q16 4096

// Quantities that follow speed and DC-link voltage slowly are renewed one group a tick.
#define SCHEDULE_GROUPS 8u
#define GROUP_DUTY 0u
#define GROUP_RESISTANCE 1u
#define GROUP_CURRENT 2u
#define GROUP_SPEED_KP 3u
#define GROUP_SPEED_KI 4u
#define GROUP_LINEARITY 5u
#define GROUP_ADVANCE 6u

static int32_t interpolate(int32_t low, int32_t high, int32_t ratio_q16) {
  return low + mul_q16(high - low, ratio_q16);
}

static int32_t diode_v_q25(const six_step_view_t *view) { return view->settings->sync_rect ? 0 : view->p->diode_v_q25; }

static int32_t lesser(int32_t a, int32_t b) { return (a < b) ? a : b; }
static int32_t greater(int32_t a, int32_t b) { return (a > b) ? a : b; }

static gain_t scaled(gain_t gain, int32_t scale_q16) {
  return (gain_t){mul_q16(gain.mant, scale_q16), gain.shift};
}

// Limits of the voltage by duty.
static void schedule_duty_limits(scheduled_t *g, const six_step_view_t *view, uint32_t longest_cycles) {
  const parameters_t *p = view->p;
  const int32_t diode = diode_v_q25(view);
  const uint32_t least_q16 = ((uint32_t)p->least_on_cycles << 16) / longest_cycles;
  const int32_t least_q30 = (least_q16 < LEAST_DUTY_MAX_Q16) ? (int32_t)(least_q16 << 14) : LEAST_DUTY_MAX_Q16 << 14;
  g->low_v_q25 = voltage_from_duty_v_q25(least_q30, view->m->vdc_v_q25, diode);
  g->high_v_q25 = voltage_from_duty_v_q25(p->duty_max_q30, view->m->vdc_v_q25, diode);
}

// Current of the conducting pair per DC-link current, and the limit that follows from both limits.
static void schedule_current(scheduled_t *g, const six_step_view_t *view, int32_t speed_rpm_q8, int32_t duty_q30) {
  const parameters_t *p = view->p;
  const gain_t copper = {p->resistance_low, p->resistance_shift + 8};
  g->line_ratio_q16 =
      line_current_ratio_q16(view->m->vdc_v_q25, gain_apply(speed_rpm_q8, p->emf),
                             gain_apply(view->m->line_i_q25, copper), diode_v_q25(view), duty_q30);
  const int32_t dc_as_line_q25 = line_current_limit_q25(view->settings->dc_limit_q17, g->line_ratio_q16);
  g->limit_i_q25 = lesser(view->settings->current_limit_q17 * 256, dc_as_line_q25);
  g->resistive_v_q25 = gain_apply(g->limit_i_q25, g->resistance);
}

static void schedule_resistance(scheduled_t *g, const parameters_t *p, int32_t ratio_q16) {
  const int32_t mant = interpolate(p->resistance_low, p->resistance_high, ratio_q16);
  g->resistance = (gain_t){mant, p->resistance_shift + 8};
  // Fewer bits of shift for the format of the integral.
  g->current.ki = (gain_t){mul_q16(mant, p->current_wt_q16), p->resistance_shift + 8 - PI_INTEGRAL_BITS};
}

// Gains of the speed regulator, first proportional, then integral.
static void schedule_speed(scheduled_t *g, const six_step_view_t *view, int32_t ratio_q16, bool integral) {
  const parameters_t *p = view->p;
  const int32_t speed_rpm_q8 = view->m->speed_rpm_q8;
  const bool current_loop = view->settings->current_loop;
  const int32_t scale_q16 =
      clamp_i32(gain_apply(speed_rpm_q8, p->speed_bandwidth_scale), BANDWIDTH_SCALE_MIN_Q16, ONE_Q16);
  if (current_loop && integral) {
    g->speed_i.ki = scaled(p->speed_to_current_ki, scale_q16);
  } else if (current_loop) {
    g->speed_i.kp = scaled(p->speed_to_current_kp, scale_q16);
    // What accelerates with the ramp; more than the limit allows would only be unwound again by the integral.
    g->acceleration_i_q25 = lesser(gain_apply(view->settings->accel_rpm_q8, p->speed_to_current_kp), g->limit_i_q25);
  } else if (integral) {
    const gain_t ki = {interpolate(p->speed_ki_low, p->speed_ki_high, ratio_q16), p->speed_ki_shift};
    g->pi.ki = scaled(ki, scale_q16);
  } else {
    g->kp_full = (gain_t){interpolate(p->speed_kp_low, p->speed_kp_high, ratio_q16), p->speed_kp_shift};
    g->pi.kp = scaled(g->kp_full, scale_q16);
    g->acceleration_v_q25 = lesser(gain_apply(view->settings->accel_rpm_q8, g->kp_full), g->resistive_v_q25);
  }
}

HOT static void schedule(regulate_t *r, const pwm_t *pwm, const six_step_view_t *view, const regulate_input_t *in,
                         uint32_t group) {
  const parameters_t *p = view->p;
  const settings_t *settings = view->settings;
  scheduled_t *g = &r->scheduled;
  const int32_t speed_rpm_q8 = view->m->speed_rpm_q8;
  const bool by_speed = group != GROUP_DUTY && group != GROUP_CURRENT && group != GROUP_LINEARITY;
  const int32_t ratio_q16 = by_speed ? clamp_i32(gain_apply(speed_rpm_q8, p->speed_ratio), 0, ONE_Q16) : 0;
  switch (group) {
    case GROUP_DUTY:
      schedule_duty_limits(g, view, in->longest_cycles);
      break;
    case GROUP_RESISTANCE:
      schedule_resistance(g, p, ratio_q16);
      break;
    case GROUP_CURRENT:
      schedule_current(g, view, speed_rpm_q8, pwm->duty_q30);
      break;
    case GROUP_SPEED_KP:
    case GROUP_SPEED_KI:
      schedule_speed(g, view, ratio_q16, group == GROUP_SPEED_KI);
      break;
    case GROUP_LINEARITY:
      if (settings->linearity) {
        g->linearity = csc_linearity(view->m->sector_cycles, in->period_cycles, CSC_TOLERANCE_Q16);
      }
      break;
    case GROUP_ADVANCE:
      g->advance_q16 = advance_added_q16(settings->advance_speed_q16, ratio_q16, settings->advance_current_q16,
                                         clamp_i32(gain_apply(view->m->line_i_q25, p->rated_current_ratio), 0, 2 * ONE_Q16));
      break;
    default:
      break;
  }
}

// Without synchronous rectification nothing brakes: below half of the EMF the pulses carry next to no current, less
// voltage slows the rotor no faster. All of the voltage below the EMF has to be regained when the target is reached,
// and the rotor falls on meanwhile: so the nearer the target, the nearer to the EMF. A fifth is left for a flux that is
// 20 % wrong: the bound must not hold the speed above the target.
//
// With it the braking current bounds the voltage.
HOT static int32_t lower_limit_v_q25(const regulate_t *r, bool sync_rect, int32_t emf_v_q25, int32_t reference_v_q25) {
  if (sync_rect) {
    const int32_t brake_v_q25 = gain_apply(r->brake_i_q25, r->scheduled.resistance);
    return greater(r->scheduled.low_v_q25, emf_v_q25 - brake_v_q25);
  }
  const int32_t depth_v_q25 = clamp_i32(4 * (emf_v_q25 - reference_v_q25), emf_v_q25 / 5, emf_v_q25 / 2);
  return greater(r->scheduled.low_v_q25, emf_v_q25 - depth_v_q25);
}

HOT static void apply_advance(regulate_t *r, const settings_t *settings) {
  r->advance_q16 = advance_total_q16(settings->advance_q16, r->scheduled.advance_q16);
}

bool regulate_turns_wrong(const settings_t *settings, bool reverse) {
  const int32_t target = settings->target_rpm;
  return target != 0 && (target < 0) != reverse;
}

HOT static regulator_t wanted_regulator(const six_step_view_t *view, bool reverse) {
  if (!view->settings->current_loop) {
    return REGULATOR_VOLTAGE;
  }
  const bool torque = view->settings->mode == MODE_TORQUE && view->order->state == STATE_RUNNING &&
                      !regulate_turns_wrong(view->settings, reverse);
  return torque ? REGULATOR_TORQUE : REGULATOR_CURRENT;
}

HOT static void apply_voltage(const regulate_t *r, pwm_t *pwm, const six_step_view_t *view,
                              const regulate_input_t *in, int32_t u_v_q25) {
  const settings_t *settings = view->settings;
  const bool linear = settings->linearity && settings->commutation == COMMUTATION_CSC;
  pwm_from_voltage(pwm, view, u_v_q25, settings->sync_rect, in->longest_cycles, linear ? &r->scheduled.linearity : 0);
}

// Set ramp and integrals so that the present voltage continues.
COLD static void preset(regulate_t *r, const pwm_t *pwm, const six_step_view_t *view) {
  const parameters_t *p = view->p;
  const int32_t speed_rpm_q8 = view->m->speed_rpm_q8;
  const int32_t emf_v_q25 = gain_apply(speed_rpm_q8, p->emf);
  scheduled_t *g = &r->scheduled;
  g->current.kp = p->current_kp;
  r->saturated = 0;
  ramp_preset(&r->ramp, speed_rpm_q8);
  r->limiter.trim_v_q25 = 0;
  if (r->regulator == REGULATOR_VOLTAGE) {
    pi_preset(&r->speed_pi, g->pi.kp, 0, emf_v_q25, pwm->u_v_q25);
    return;
  }
  const int32_t i_q25 = clamp_i32(view->m->line_i_q25, -r->brake_i_q25, g->limit_i_q25);
  r->reference_i_q25 = i_q25;
  pi_preset(&r->speed_pi, g->speed_i.kp, 0, 0, i_q25);
  pi_preset(&r->current_pi, p->current_kp, 0, emf_v_q25 + gain_apply(i_q25, g->resistance), pwm->u_v_q25);
}

void regulate_init(regulate_t *r, const settings_t *settings) { r->advance_q16 = settings->advance_q16; }

static void choose_regulator(regulate_t *r, const six_step_view_t *view, bool reverse) {
  r->regulator = wanted_regulator(view, reverse);
  r->linear = view->settings->linearity;
}

COLD void regulate_prepare(regulate_t *r, const pwm_t *pwm, const six_step_view_t *view, const regulate_input_t *in,
                           uint32_t ticks) {
  choose_regulator(r, view, in->reverse);
  // The groups build on each other in their order.
  schedule(r, pwm, view, in, ticks % SCHEDULE_GROUPS);
}

// Another regulator: its gains are not scheduled yet.
COLD static void change_regulator(regulate_t *r, const pwm_t *pwm, const six_step_view_t *view,
                                  const regulate_input_t *in) {
  choose_regulator(r, view, in->reverse);
  schedule(r, pwm, view, in, GROUP_SPEED_KP);
  schedule(r, pwm, view, in, GROUP_SPEED_KI);
  schedule(r, pwm, view, in, GROUP_LINEARITY);
  preset(r, pwm, view);
}

COLD void regulate_begin(regulate_t *r, pwm_t *pwm, const six_step_view_t *view, const regulate_input_t *in) {
  r->was_frozen = false;
  r->limit = LIMIT_NONE;
  preset(r, pwm, view);
  apply_advance(r, view->settings);
  apply_voltage(r, pwm, view, in, pwm->u_v_q25);
}

COLD void regulate_freeze(regulate_t *r) { r->was_frozen = true; }

// Speed regulator straight to the voltage, between the limits of current and duty.
HOT static int32_t voltage_step(regulate_t *r, const pwm_t *pwm, const six_step_view_t *view, int32_t direction) {
  const parameters_t *p = view->p;
  const measured_t *m = view->m;
  const settings_t *s = view->settings;
  const scheduled_t *g = &r->scheduled;
  const int32_t reference = r->ramp.value_rpm_q8;
  const int32_t reference_v_q25 = gain_apply(reference, p->emf);
  const int32_t feed_forward = reference_v_q25 + direction * g->acceleration_v_q25;

  const limiter_gains_t limiter_gains = {p->limiter_kp, p->limiter_ki};
  // The magnitude of a braking current has its own limit.
  const int32_t motor_q17 = (m->idc_q17 >= 0) ? m->motor_q17 : 0;
  const int32_t margin_q17 = lesser(s->current_limit_q17 - motor_q17, s->dc_limit_q17 - m->idc_q17);
  const int32_t emf_v_q25 = gain_apply(m->speed_rpm_q8, p->emf);
  const int32_t high_current =
      limiter_bound(&r->limiter, &limiter_gains, emf_v_q25, g->resistive_v_q25, margin_q17);
  // The least duty keeps the crossings visible and stands above the current limit.
  const int32_t high = greater(lesser(g->high_v_q25, high_current), g->low_v_q25);
  const int32_t low = lesser(lower_limit_v_q25(r, view->settings->sync_rect, emf_v_q25, reference_v_q25), high);
  const pi_result_t u = pi_step(&r->speed_pi, &g->pi, reference - m->speed_rpm_q8, feed_forward, low, high);
  // The slew is behind the regulator: it only smooths the voltage (full range in a few ms). Fed back into the integral
  // it would turn skewed jitter of the measured speed (RSC with late crossings) into a lasting speed error. It must not
  // hold the voltage above the limits.
  const int32_t slewed = clamp_i32(u.output, pwm->u_v_q25 - p->slew_v_q25, pwm->u_v_q25 + p->slew_v_q25);
  const int32_t output = lesser(slewed, high);
  r->limit = LIMIT_NONE;
  if (u.output < u.unlimited) {
    r->limit = (high_current < g->high_v_q25) ? LIMIT_CURRENT : LIMIT_DUTY_MAX;
  } else if (u.output > u.unlimited) {
    r->limit = LIMIT_DUTY_MIN;
  } else if (output != u.output) {
    r->limit = LIMIT_SLEW;
  }
  limiter_update(&r->limiter, &limiter_gains, g->resistive_v_q25, margin_q17, r->limit == LIMIT_CURRENT);
  return output;
}

// Current reference from the speed regulator or the torque target. While the voltage is at a limit, a reference beyond
// what flows could not be followed: it stays near the measured current, and the speed regulator's integral with it.
HOT static void reference_step(regulate_t *r, const six_step_view_t *view, int32_t direction, int32_t target_rpm_q8) {
  const parameters_t *p = view->p;
  const measured_t *m = view->m;
  const scheduled_t *g = &r->scheduled;
  int32_t high = g->limit_i_q25;
  int32_t low = view->settings->sync_rect ? -r->brake_i_q25 : 0;
  const int32_t room = g->limit_i_q25 / 8;
  if (r->saturated > 0) {
    high = clamp_i32(m->line_i_q25 + room, low, high);
  } else if (r->saturated < 0) {
    low = clamp_i32(m->line_i_q25 - room, low, high);
  }
  if (r->regulator == REGULATOR_TORQUE) {
    r->ramp.value_rpm_q8 = m->speed_rpm_q8;
    r->reference_i_q25 = torque_reference(view->settings->target_i_q25, p->speed_to_current_kp, m->speed_rpm_q8,
                                              p->stop_rpm * 256, target_rpm_q8, low, high);
    r->limit = (view->settings->target_i_q25 > high) ? LIMIT_CURRENT : LIMIT_NONE;
    return;
  }
  const pi_result_t i = pi_step(&r->speed_pi, &g->speed_i, r->ramp.value_rpm_q8 - m->speed_rpm_q8,
                                direction * g->acceleration_i_q25, low, high);
  r->reference_i_q25 = i.output;
  r->limit = (i.output < i.unlimited) ? LIMIT_CURRENT : LIMIT_NONE;
}

// Current regulator. The slew is one of its limits: the integral follows what is applied.
HOT static int32_t current_step(regulate_t *r, const pwm_t *pwm, const six_step_view_t *view) {
  const parameters_t *p = view->p;
  const measured_t *m = view->m;
  const scheduled_t *g = &r->scheduled;
  const int32_t reference = r->reference_i_q25;
  const int32_t emf_v_q25 = gain_apply(m->speed_rpm_q8, p->emf);
  const int32_t feed_forward = emf_v_q25 + gain_apply(reference, g->resistance);
  const int32_t reference_v_q25 =
      (r->regulator == REGULATOR_TORQUE) ? 0 : gain_apply(r->ramp.value_rpm_q8, p->emf);
  const int32_t least = lesser(lower_limit_v_q25(r, view->settings->sync_rect, emf_v_q25, reference_v_q25), g->high_v_q25);
  const int32_t high = clamp_i32(pwm->u_v_q25 + p->slew_v_q25, least, g->high_v_q25);
  const int32_t low = clamp_i32(pwm->u_v_q25 - p->slew_v_q25, least, high);
  const pi_result_t u =
      pi_step(&r->current_pi, &g->current, reference - m->line_i_q25, feed_forward, low, high);
  r->saturated = 0;
  if (u.output < u.unlimited && high == g->high_v_q25) {
    r->saturated = 1;
    r->limit = LIMIT_DUTY_MAX;
  } else if (u.output > u.unlimited && low == least) {
    r->saturated = -1;
    r->limit = LIMIT_DUTY_MIN;
  } else if (u.output != u.unlimited) {
    r->limit = LIMIT_SLEW;
  }
  return u.output;
}

HOT void regulate_step(regulate_t *r, pwm_t *pwm, const six_step_view_t *view, const regulate_input_t *in,
                       int32_t target_rpm_q8) {
  const parameters_t *p = view->p;
  const settings_t *settings = view->settings;
  const measured_t *m = view->m;
  const bool switched = r->regulator != wanted_regulator(view, in->reverse) || r->linear != settings->linearity;
  if (switched) {
    change_regulator(r, pwm, view, in);
  } else if (r->was_frozen) {
    preset(r, pwm, view);
  }
  r->was_frozen = false;
  apply_advance(r, settings);
  // A tick that divides for a new speed leaves the schedule to another one as well, once.
  r->schedule_skipped = in->thresholds_move || (m->speed_fresh && !r->schedule_skipped);
  if (!r->schedule_skipped) {
    schedule(r, pwm, view, in, r->schedule_group);
    r->schedule_group = (r->schedule_group + 1u) % SCHEDULE_GROUPS;
  }
  if (settings->sync_rect) {
    r->brake_i_q25 =
        brake_current(r->brake_i_q25, settings->brake_limit_i_q25, m->vdc_v_q25, p->brake_vdc_v_q25, p->brake_range);
  }
  int32_t output;
  const int32_t direction =
      ramp_step(&r->ramp, target_rpm_q8, settings->accel_rpm_q20, m->speed_rpm_q8, p->ramp_window_rpm * 256);
  if (r->regulator == REGULATOR_VOLTAGE) {
    output = voltage_step(r, pwm, view, direction);
  } else {
    reference_step(r, view, direction, target_rpm_q8);
    output = current_step(r, pwm, view);
  }
  apply_voltage(r, pwm, view, in, output);
}

bool regulate_nearly_stopped(const regulate_t *r, const six_step_view_t *view) {
  const int32_t stop_rpm = view->p->stop_rpm;
  const int32_t speed_rpm_q8 = view->m->speed_rpm_q8;
  const int32_t emf_v_q25 = gain_apply(speed_rpm_q8, view->p->emf);
  const bool held = view->settings->sync_rect && emf_v_q25 < r->scheduled.low_v_q25 / 4 * 5;
  return speed_rpm_q8 < stop_rpm * 256 + stop_rpm * 16 || held;
}
