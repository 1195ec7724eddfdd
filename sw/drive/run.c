// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "drive/run.h"

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

static int32_t diode_v_q25(const drive_t *drive) { return drive->settings.sync_rect ? 0 : drive->p->diode_v_q25; }

static int32_t lesser(int32_t a, int32_t b) { return (a < b) ? a : b; }
static int32_t greater(int32_t a, int32_t b) { return (a > b) ? a : b; }

static gain_t scaled(gain_t gain, int32_t scale_q16) {
  return (gain_t){mul_q16(gain.mant, scale_q16), gain.shift};
}

// Limits of the voltage by duty.
static void schedule_duty_limits(drive_t *drive) {
  const parameters_t *p = drive->p;
  scheduled_t *g = &drive->scheduled;
  const int32_t diode = diode_v_q25(drive);
  const uint32_t least_q16 = ((uint32_t)p->least_on_cycles << 16) / drive->m.longest_cycles;
  const int32_t least_q30 = (least_q16 < LEAST_DUTY_MAX_Q16) ? (int32_t)(least_q16 << 14) : LEAST_DUTY_MAX_Q16 << 14;
  g->low_v_q25 = voltage_from_duty_v_q25(least_q30, drive->m.vdc_v_q25, diode);
  g->high_v_q25 = voltage_from_duty_v_q25(p->duty_max_q30, drive->m.vdc_v_q25, diode);
}

// Current of the conducting pair per DC-link current, and the limit that follows from both limits.
static void schedule_current(drive_t *drive, int32_t speed_rpm_q8) {
  const parameters_t *p = drive->p;
  scheduled_t *g = &drive->scheduled;
  const gain_t copper = {p->resistance_low, p->resistance_shift + 8};
  g->line_ratio_q16 =
      line_current_ratio_q16(drive->m.vdc_v_q25, gain_apply(speed_rpm_q8, p->emf),
                             gain_apply(drive->m.line_i_q25, copper), diode_v_q25(drive), drive->duty_q30);
  const int32_t dc_as_line_q25 = line_current_limit_q25(drive->settings.dc_limit_q17, g->line_ratio_q16);
  g->limit_i_q25 = lesser(drive->settings.current_limit_q17 * 256, dc_as_line_q25);
  g->resistive_v_q25 = gain_apply(g->limit_i_q25, g->resistance);
}

static void schedule_resistance(drive_t *drive, int32_t ratio_q16) {
  const parameters_t *p = drive->p;
  scheduled_t *g = &drive->scheduled;
  const int32_t mant = interpolate(p->resistance_low, p->resistance_high, ratio_q16);
  g->resistance = (gain_t){mant, p->resistance_shift + 8};
  // Fewer bits of shift for the format of the integral.
  g->current.ki = (gain_t){mul_q16(mant, p->current_wt_q16), p->resistance_shift + 8 - PI_INTEGRAL_BITS};
}

// Gains of the speed regulator, first proportional, then integral.
static void schedule_speed(drive_t *drive, int32_t speed_rpm_q8, int32_t ratio_q16, bool integral) {
  const parameters_t *p = drive->p;
  scheduled_t *g = &drive->scheduled;
  const bool current_loop = drive->settings.current_loop;
  const int32_t scale_q16 =
      clamp_i32(gain_apply(speed_rpm_q8, p->speed_bandwidth_scale), BANDWIDTH_SCALE_MIN_Q16, ONE_Q16);
  if (current_loop && integral) {
    g->speed_i.ki = scaled(p->speed_to_current_ki, scale_q16);
  } else if (current_loop) {
    g->speed_i.kp = scaled(p->speed_to_current_kp, scale_q16);
    // What accelerates with the ramp; more than the limit allows would only be unwound again by the integral.
    g->acceleration_i_q25 = lesser(gain_apply(drive->settings.accel_rpm_q8, p->speed_to_current_kp), g->limit_i_q25);
  } else if (integral) {
    const gain_t ki = {interpolate(p->speed_ki_low, p->speed_ki_high, ratio_q16), p->speed_ki_shift};
    g->pi.ki = scaled(ki, scale_q16);
  } else {
    g->kp_full = (gain_t){interpolate(p->speed_kp_low, p->speed_kp_high, ratio_q16), p->speed_kp_shift};
    g->pi.kp = scaled(g->kp_full, scale_q16);
    g->acceleration_v_q25 = lesser(gain_apply(drive->settings.accel_rpm_q8, g->kp_full), g->resistive_v_q25);
  }
}

HOT static void schedule(drive_t *drive, uint32_t group) {
  const parameters_t *p = drive->p;
  const int32_t speed_rpm_q8 = drive->m.speed_rpm_q8;
  const bool by_speed = group != GROUP_DUTY && group != GROUP_CURRENT && group != GROUP_LINEARITY;
  const int32_t ratio_q16 = by_speed ? clamp_i32(gain_apply(speed_rpm_q8, p->speed_ratio), 0, ONE_Q16) : 0;
  switch (group) {
    case GROUP_DUTY:
      schedule_duty_limits(drive);
      break;
    case GROUP_RESISTANCE:
      schedule_resistance(drive, ratio_q16);
      break;
    case GROUP_CURRENT:
      schedule_current(drive, speed_rpm_q8);
      break;
    case GROUP_SPEED_KP:
    case GROUP_SPEED_KI:
      schedule_speed(drive, speed_rpm_q8, ratio_q16, group == GROUP_SPEED_KI);
      break;
    case GROUP_LINEARITY:
      if (drive->settings.linearity) {
        drive->scheduled.linearity =
            csc_linearity(drive->m.sector_cycles, drive->command.period_cycles, (uint32_t)p->csc_tolerance_q16);
      }
      break;
    case GROUP_ADVANCE:
      drive->scheduled.advance_q16 = advance_added_q16(
          drive->settings.advance_speed_q16, ratio_q16, drive->settings.advance_current_q16,
          clamp_i32(gain_apply(drive->m.line_i_q25, p->rated_current_ratio), 0, 2 * ONE_Q16));
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
HOT static int32_t lower_limit_v_q25(const drive_t *drive, int32_t emf_v_q25, int32_t reference_v_q25) {
  if (drive->settings.sync_rect) {
    const int32_t brake_v_q25 = gain_apply(drive->brake_i_q25, drive->scheduled.resistance);
    return greater(drive->scheduled.low_v_q25, emf_v_q25 - brake_v_q25);
  }
  const int32_t depth_v_q25 = clamp_i32(4 * (emf_v_q25 - reference_v_q25), emf_v_q25 / 5, emf_v_q25 / 2);
  return greater(drive->scheduled.low_v_q25, emf_v_q25 - depth_v_q25);
}

// Settings that the console may change while running.
COLD static void apply_settings(drive_t *drive) {
  const settings_t *s = &drive->settings;
  drive->settings_fresh = false;
  drive->command.write_modes = true;
  drive->command.commutation = s->commutation;
  drive->command.pattern = s->pattern;
  drive_take_crossing(drive);
}

HOT static void apply_advance(drive_t *drive) {
  drive->command.advance_q16 = advance_total_q16(drive->settings.advance_q16, drive->scheduled.advance_q16);
}

HOT static regulator_t wanted_regulator(const drive_t *drive) {
  if (!drive->settings.current_loop) {
    return REGULATOR_VOLTAGE;
  }
  const bool torque = drive->settings.mode == MODE_TORQUE && drive->state == STATE_RUNNING && !drive_turns_wrong(drive);
  return torque ? REGULATOR_TORQUE : REGULATOR_CURRENT;
}

// Set ramp and integrals so that the present voltage continues.
COLD static void preset(drive_t *drive) {
  const int32_t speed_rpm_q8 = drive->m.speed_rpm_q8;
  const int32_t emf_v_q25 = gain_apply(speed_rpm_q8, drive->p->emf);
  const scheduled_t *g = &drive->scheduled;
  drive->scheduled.current.kp = drive->p->current_kp;
  drive->saturated = 0;
  ramp_preset(&drive->ramp, speed_rpm_q8);
  drive->limiter.trim_v_q25 = 0;
  if (drive->regulator == REGULATOR_VOLTAGE) {
    pi_preset(&drive->speed_pi, g->pi.kp, 0, emf_v_q25, drive->u_v_q25);
    return;
  }
  const int32_t i_q25 = clamp_i32(drive->m.line_i_q25, -drive->brake_i_q25, g->limit_i_q25);
  drive->reference_i_q25 = i_q25;
  pi_preset(&drive->speed_pi, g->speed_i.kp, 0, 0, i_q25);
  pi_preset(&drive->current_pi, drive->p->current_kp, 0, emf_v_q25 + gain_apply(i_q25, g->resistance), drive->u_v_q25);
}

COLD void run_prepare(drive_t *drive) {
  drive->regulator = wanted_regulator(drive);
  drive->linear = drive->settings.linearity;
  // The groups build on each other in their order.
  schedule(drive, drive->state_ticks % SCHEDULE_GROUPS);
}

// Another regulator: its gains are not scheduled yet.
COLD static void change_regulator(drive_t *drive) {
  drive->regulator = wanted_regulator(drive);
  drive->linear = drive->settings.linearity;
  schedule(drive, GROUP_SPEED_KP);
  schedule(drive, GROUP_SPEED_KI);
  schedule(drive, GROUP_LINEARITY);
  preset(drive);
}

COLD void run_begin(drive_t *drive) {
  drive_enter(drive, STATE_RUNNING);
  drive->was_frozen = false;
  drive->command.force_on_miss = true;
  drive->command.timeout_q12 = (uint32_t)drive->p->timeout_q12;
  drive->command.sampling = (uint32_t)drive->p->sample_mode;
  preset(drive);
  apply_settings(drive);
  apply_advance(drive);
  drive_apply_voltage(drive, drive->u_v_q25, drive->settings.sync_rect);
}

// Speed regulator straight to the voltage, between the limits of current and duty.
HOT static int32_t voltage_step(drive_t *drive, int32_t direction) {
  const parameters_t *p = drive->p;
  const measured_t *m = &drive->m;
  const settings_t *s = &drive->settings;
  const scheduled_t *g = &drive->scheduled;
  const int32_t reference = drive->ramp.value_rpm_q8;
  const int32_t reference_v_q25 = gain_apply(reference, p->emf);
  const int32_t feed_forward = reference_v_q25 + direction * g->acceleration_v_q25;

  const limiter_gains_t limiter_gains = {p->limiter_kp, p->limiter_ki};
  // The magnitude of a braking current has its own limit.
  const int32_t motor_q17 = (m->idc_q17 >= 0) ? m->motor_q17 : 0;
  const int32_t margin_q17 = lesser(s->current_limit_q17 - motor_q17, s->dc_limit_q17 - m->idc_q17);
  const int32_t emf_v_q25 = gain_apply(m->speed_rpm_q8, p->emf);
  const int32_t high_current =
      limiter_bound(&drive->limiter, &limiter_gains, emf_v_q25, g->resistive_v_q25, margin_q17);
  // The least duty keeps the crossings visible and stands above the current limit.
  const int32_t high = greater(lesser(g->high_v_q25, high_current), g->low_v_q25);
  const int32_t low = lesser(lower_limit_v_q25(drive, emf_v_q25, reference_v_q25), high);
  const pi_result_t u = pi_step(&drive->speed_pi, &g->pi, reference - m->speed_rpm_q8, feed_forward, low, high);
  // The slew is behind the regulator: it only smooths the voltage (full range in a few ms). Fed back into the integral
  // it would turn skewed jitter of the measured speed (RSC with late crossings) into a lasting speed error. It must not
  // hold the voltage above the limits.
  const int32_t slewed = clamp_i32(u.output, drive->u_v_q25 - p->slew_v_q25, drive->u_v_q25 + p->slew_v_q25);
  const int32_t output = lesser(slewed, high);
  drive->limit = LIMIT_NONE;
  if (u.output < u.unlimited) {
    drive->limit = (high_current < g->high_v_q25) ? LIMIT_CURRENT : LIMIT_DUTY_MAX;
  } else if (u.output > u.unlimited) {
    drive->limit = LIMIT_DUTY_MIN;
  } else if (output != u.output) {
    drive->limit = LIMIT_SLEW;
  }
  limiter_update(&drive->limiter, &limiter_gains, g->resistive_v_q25, margin_q17, drive->limit == LIMIT_CURRENT);
  return output;
}

// Current reference from the speed regulator or the torque target. While the voltage is at a limit, a reference beyond
// what flows could not be followed: it stays near the measured current, and the speed regulator's integral with it.
HOT static void reference_step(drive_t *drive, int32_t direction, int32_t target_rpm_q8) {
  const parameters_t *p = drive->p;
  const measured_t *m = &drive->m;
  const scheduled_t *g = &drive->scheduled;
  int32_t high = g->limit_i_q25;
  int32_t low = drive->settings.sync_rect ? -drive->brake_i_q25 : 0;
  const int32_t room = g->limit_i_q25 / 8;
  if (drive->saturated > 0) {
    high = clamp_i32(m->line_i_q25 + room, low, high);
  } else if (drive->saturated < 0) {
    low = clamp_i32(m->line_i_q25 - room, low, high);
  }
  if (drive->regulator == REGULATOR_TORQUE) {
    drive->ramp.value_rpm_q8 = m->speed_rpm_q8;
    drive->reference_i_q25 = torque_reference(drive->settings.target_i_q25, p->speed_to_current_kp, m->speed_rpm_q8,
                                              p->stop_rpm * 256, target_rpm_q8, low, high);
    drive->limit = (drive->settings.target_i_q25 > high) ? LIMIT_CURRENT : LIMIT_NONE;
    return;
  }
  const pi_result_t i = pi_step(&drive->speed_pi, &g->speed_i, drive->ramp.value_rpm_q8 - m->speed_rpm_q8,
                                direction * g->acceleration_i_q25, low, high);
  drive->reference_i_q25 = i.output;
  drive->limit = (i.output < i.unlimited) ? LIMIT_CURRENT : LIMIT_NONE;
}

// Current regulator. The slew is one of its limits: the integral follows what is applied.
HOT static int32_t current_step(drive_t *drive) {
  const parameters_t *p = drive->p;
  const measured_t *m = &drive->m;
  const scheduled_t *g = &drive->scheduled;
  const int32_t reference = drive->reference_i_q25;
  const int32_t emf_v_q25 = gain_apply(m->speed_rpm_q8, p->emf);
  const int32_t feed_forward = emf_v_q25 + gain_apply(reference, g->resistance);
  const int32_t reference_v_q25 =
      (drive->regulator == REGULATOR_TORQUE) ? 0 : gain_apply(drive->ramp.value_rpm_q8, p->emf);
  const int32_t least = lesser(lower_limit_v_q25(drive, emf_v_q25, reference_v_q25), g->high_v_q25);
  const int32_t high = clamp_i32(drive->u_v_q25 + p->slew_v_q25, least, g->high_v_q25);
  const int32_t low = clamp_i32(drive->u_v_q25 - p->slew_v_q25, least, high);
  const pi_result_t u =
      pi_step(&drive->current_pi, &g->current, reference - m->line_i_q25, feed_forward, low, high);
  drive->saturated = 0;
  if (u.output < u.unlimited && high == g->high_v_q25) {
    drive->saturated = 1;
    drive->limit = LIMIT_DUTY_MAX;
  } else if (u.output > u.unlimited && low == least) {
    drive->saturated = -1;
    drive->limit = LIMIT_DUTY_MIN;
  } else if (u.output != u.unlimited) {
    drive->limit = LIMIT_SLEW;
  }
  return u.output;
}

HOT void run_step(drive_t *drive, int32_t target_rpm_q8) {
  if (drive->settings.freeze && drive->state == STATE_RUNNING) {
    drive->was_frozen = true;
    return;
  }
  const bool switched =
      drive->regulator != wanted_regulator(drive) || drive->linear != drive->settings.linearity;
  if (switched) {
    change_regulator(drive);
  } else if (drive->was_frozen) {
    preset(drive);
  }
  drive->was_frozen = false;
  if (drive->settings_fresh) {
    apply_settings(drive);
  }
  apply_advance(drive);
  // A tick that moves thresholds leaves the schedule to another one; so does one that divides for a new speed, once.
  drive->schedule_skipped = drive->thresholds.busy || (drive->m.speed_fresh && !drive->schedule_skipped);
  if (!drive->schedule_skipped) {
    schedule(drive, drive->schedule_group);
    drive->schedule_group = (drive->schedule_group + 1u) % SCHEDULE_GROUPS;
  }
  if (drive->settings.sync_rect) {
    drive->brake_i_q25 = brake_current(drive->brake_i_q25, drive->settings.brake_limit_i_q25, drive->m.vdc_v_q25,
                                       drive->p->brake_vdc_v_q25, drive->p->brake_range);
  }
  int32_t output;
  const int32_t direction = ramp_step(&drive->ramp, target_rpm_q8, drive->settings.accel_rpm_q20,
                                      drive->m.speed_rpm_q8, drive->p->ramp_window_rpm * 256);
  if (drive->regulator == REGULATOR_VOLTAGE) {
    output = voltage_step(drive, direction);
  } else {
    reference_step(drive, direction, target_rpm_q8);
    output = current_step(drive);
  }
  drive_apply_voltage(drive, output, drive->settings.sync_rect);
}
