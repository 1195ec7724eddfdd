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
// One over the phase that the delay of the speed may cost: all of the line over the parameter.
#define WHOLE_Q16 187246
// Share of the speed that noise may swing below the reference, of the current that the gain makes of it.
#define SPEED_NOISE 512
// EMF of a pair of sinusoidal phases within a sector, over its mean: 1 + 0.5586 (1/12 - y^2), y from the middle.
#define ROUND_Q16 36608
#define ROUND_STEP_MAX_Q16 8192
#define ROUND_STEP_MAX_FIRM_Q16 16384
// Voltage at the end of a sector that unequal fluxes add, over the difference of the pairs beside it: pi / (3 sqrt 3).
#define LEAN_Q16 39622
// What is left of the pairs' difference at their commutation: 1 - pi / (6 sqrt 3).
#define STEP_Q16 45725
// Trim of a firm drive over what a speed over the turn allows.
#define FIRM_TRIM 3
// Fewest ticks of the lag: a measured speed is taken at most every second tick.
#define LAG_MAX_Q16 21845
// The ramp's last steps.
#define RAMP_STEP_MIN_Q20 4096
// Most that the speed of now may differ from the measured one where a place in the sector follows from it.
#define MOVED_MAX_Q12 1024
// Share of the speed, by a shift, that the ramp goes up in a sector, and how often as far it goes down: a crossing follows the
// one before.
#define SECTOR_UP_SHIFT 3
#define SECTOR_DOWN 2
// Most that the EMF may differ from the file's, and share of it that R I may be where that is looked at.
#define FLUX_MAX_Q12 512
#define FLUX_LOOK 8
// Share of the EMF up to which the balance of power tells a braking current.
#define BRAKE_BALANCE 3
// Share of the speed that the ramp may have gone since the measured one.
#define FLUX_REST 64
#define DEAD_STEEP_MAX 64
// Integral of a firm drive where the load is near the boundary's current.
#define BOUNDARY_SLOWER 3
// Share of the current limit by which a bound may be wrong.
#define ROOM 8
#define BRAKE_ROOM 16
// Share of it that the ramp may ask for in any case.
#define ROOM_MIN 16
// What freewheeling leaves of the half sector before the crossing: a sixteenth of the sector, and 11 us in which samples of the
// terminal may be missing, at most half of it. Where late crossings are computed back: its part of the sector.
#define FREEWHEEL_ROOM_CYCLES 550u
#define FREEWHEEL_BACK_X16 14u
#define FREEWHEEL_EMF_Q16 9830

// Quantities that follow speed and DC-link voltage slowly are renewed one group a tick.
#define SCHEDULE_GROUPS 8u
#define GROUP_DUTY 0u
#define GROUP_RESISTANCE 1u
#define GROUP_CURRENT 2u
#define GROUP_SPEED 3u
#define GROUP_BOUNDARY 4u
#define GROUP_LINEARITY 5u
#define GROUP_ADVANCE 6u
#define GROUP_LEAST 7u

static int32_t interpolate(int32_t low, int32_t high, int32_t ratio_q16) {
  return low + mul_q16(high - low, ratio_q16);
}

static int32_t diode_v_q25(const six_step_view_t *view, const pwm_t *pwm) {
  return pwm->sync_rect ? 0 : view->p->diode_v_q25;
}

static int32_t lesser(int32_t a, int32_t b) { return (a < b) ? a : b; }
static int32_t greater(int32_t a, int32_t b) { return (a > b) ? a : b; }

// Limits of the voltage by duty.
static void schedule_duty_limits(scheduled_t *g, const six_step_view_t *view, const pwm_t *pwm, uint32_t longest_cycles) {
  const parameters_t *p = view->p;
  const int32_t diode = diode_v_q25(view, pwm);
  const uint32_t least_q16 = ((uint32_t)p->least_on_cycles << 16) / longest_cycles;
  const int32_t least_q30 = (least_q16 < LEAST_DUTY_MAX_Q16) ? (int32_t)(least_q16 << 14) : LEAST_DUTY_MAX_Q16 << 14;
  g->low_v_q25 = voltage_from_duty_v_q25(least_q30, view->m->vdc_v_q25, diode);
  g->high_v_q25 = voltage_from_duty_v_q25(p->duty_max_q30, view->m->vdc_v_q25, diode);
}

// Largest current that freewheeling takes down before the crossing comes, 30 degrees after a commutation, or before the
// next commutation where late crossings are computed back. Against it stand a third of the link and the outgoing phase's
// EMF, 0.15 of the pair's in the mean; while the pulse is off, where the switch beside the diode chops, two thirds of the
// link, else none.
static int32_t freewheel_limit_i_q25(const six_step_view_t *view, const pwm_t *pwm) {
  const int32_t vdc_v_q25 = view->m->vdc_v_q25;
  const int32_t on_v_q25 = clamp_i32(pwm->u_v_q25, 0, vdc_v_q25);
  const int32_t chopped_v_q25 = (view->settings->pattern == PATTERN_ON_PWM) ? 2 * vdc_v_q25 - on_v_q25 : on_v_q25;
  const int32_t driving_v_q25 = chopped_v_q25 / 3 + mul_q16(view->m->emf_v_q25, FREEWHEEL_EMF_Q16);
  const bool back = view->settings->crossing.compute_back;
  const uint32_t sector_cycles = view->m->sector_cycles;
  const uint32_t room_cycles = clamp_u32(FREEWHEEL_ROOM_CYCLES, sector_cycles / 16u, sector_cycles / 4u);
  const uint32_t time_cycles = back ? sector_cycles / 16u * FREEWHEEL_BACK_X16 : sector_cycles / 2u - room_cycles;
  // per_volt is that of two phases and half of a carrier: L of one phase is a quarter.
  const int32_t per_carrier_i_q25 = gain_apply(driving_v_q25, view->p->boundary_current);
  return sat_i32(((int64_t)per_carrier_i_q25 * (int32_t)time_cycles) >> (BOUNDARY_CYCLES_SHIFT - 2));
}

// The measured speed is a mean over the last intervals: since their middle the rotor has followed the ramp.
HOT static int32_t speed_now_rpm_q8(const regulate_t *r, const measured_t *m) {
  return m->speed_rpm_q8 + r->rotor_rpm_q8 - r->lagged_rpm_q8;
}

// What the gains follow from.
static int32_t scheduled_rpm_q8(const regulate_t *r, const six_step_view_t *view) {
  return is_firm(view->settings) ? speed_now_rpm_q8(r, view->m) : view->m->speed_rpm_q8;
}

HOT static int32_t emf_now_v_q25(const regulate_t *r, const six_step_view_t *view) {
  const int32_t moved_rpm_q8 = r->rotor_rpm_q8 - r->lagged_rpm_q8;
  return view->m->emf_v_q25 + ((moved_rpm_q8 != 0) ? gain_apply(moved_rpm_q8, view->p->emf) : 0);
}

// Current of the conducting pair per DC-link current, and the limit that follows from both limits.
static void schedule_current(regulate_t *r, const six_step_view_t *view, const pwm_t *pwm) {
  scheduled_t *g = &r->scheduled;
  const parameters_t *p = view->p;
  const gain_t copper = {p->resistance_low, p->resistance_shift + 8};
  // A sample in the pulse shows the pair's current itself.
  const bool mean = p->sample_mode == SAMPLING_CONTINUOUS;
  const int32_t emf_v_q25 = view->settings->sync_rect ? emf_now_v_q25(r, view) : view->m->emf_v_q25;
  // Two braking currents i give the same power i (E + R i), equal ones at E/2: short of that the voltage says E + R i.
  const int32_t copper_v_q25 = gain_apply(view->m->line_i_q25, copper);
  const int32_t resistive_v_q25 = (copper_v_q25 < -emf_v_q25 / BRAKE_BALANCE) ? pwm->u_v_q25 - emf_v_q25 : copper_v_q25;
  g->line_ratio_q16 = !mean ? ONE_Q16 : line_current_ratio_q16(view->m->vdc_v_q25, emf_v_q25, resistive_v_q25,
                                                               diode_v_q25(view, pwm), pwm->duty_q30);
  const int32_t dc_as_line_q25 = line_current_limit_q25(view->settings->dc_limit_q17, g->line_ratio_q16);
  g->limit_i_q25 = lesser(view->settings->current_limit_q17 * 256, dc_as_line_q25);
  if (p->freewheel_limit != 0) {
    g->limit_i_q25 = lesser(g->limit_i_q25, freewheel_limit_i_q25(view, pwm));
  }
  g->resistive_v_q25 = gain_apply(g->limit_i_q25, g->resistance);
}

// Boundary of continuous conduction. The current's least value meets zero there: it moves by (vdc - E) t_d / L_l between a dead
// time that takes nothing and one that takes all. A reference that swings with a late speed is better answered evenly.
static void schedule_boundary(scheduled_t *g, const six_step_view_t *view, const pwm_t *pwm) {
  const int32_t period_cycles = (int32_t)view->settings->carrier_period_cycles;
  g->boundary = boundary(view->m->emf_v_q25, view->m->vdc_v_q25, diode_v_q25(view, pwm), (uint32_t)period_cycles,
                         view->p->boundary_current);
  const int32_t pulse_cycles = mul_q16(g->boundary.duty_q30 >> 14, period_cycles);
  const int32_t twice_cycles = 2 * view->p->dead_time_cycles + 1;
  g->dead_steep = is_firm(view->settings) ? clamp_i32(pulse_cycles / twice_cycles, 1, DEAD_STEEP_MAX) : 1;
}

// Current of the shortest pulse in the longest carrier, where diodes end it.
static void schedule_least(scheduled_t *g, const six_step_view_t *view, uint32_t longest_cycles) {
  const uint32_t wanted_cycles = view->settings->carrier_period_cycles;
  const uint32_t edge_cycles = (uint32_t)mul_q16(g->boundary.duty_q30 >> 14, (int32_t)wanted_cycles);
  const uint32_t least_cycles = (uint32_t)view->p->least_on_cycles;
  // I = I_b (least / D_b T)^2 T / T_longest
  const uint32_t ratio_q12 = clamp_u32((least_cycles << 12) / clamp_u32(edge_cycles, 1u, UINT32_MAX), 0, 16u << 12);
  const uint32_t square_q16 = (ratio_q12 * (ratio_q12 >> 4)) >> 4;
  const uint32_t shorter_q16 = (wanted_cycles << 16) / longest_cycles;
  const uint64_t share_q16 = ((uint64_t)square_q16 * shorter_q16) >> 16;
  g->least_i_q25 = sat_i32(((int64_t)g->boundary.current_i_q25 * (int32_t)share_q16) >> 16);
}

static void schedule_resistance(scheduled_t *g, const six_step_view_t *view, int32_t ratio_q16) {
  const parameters_t *p = view->p;
  const int32_t mant = interpolate(p->resistance_low, p->resistance_high, ratio_q16);
  g->resistance = (gain_t){mant, p->resistance_shift + 8};
  // Fewer bits of shift for the format of the integral.
  const int32_t shift = p->resistance_shift + 8 - PI_INTEGRAL_BITS;
  g->trim = (pi_gains_t){p->trim_kp, {mul_q16(mant, p->trim_wt_q16), shift}};
  if (view->settings->current_loop) {
    g->current = (pi_gains_t){p->current_kp, {mul_q16(mant, p->current_wt_q16), shift}};
  } else {
    // The speed is a mean over a turn: a trim must not be quicker than it. A firm drive's reference has the late speed,
    // the measured current the speed of now: the trim takes part of the EMF line's hold away.
    const int32_t slow_q16 = is_firm(view->settings) ? g->scale_q16 / FIRM_TRIM : g->scale_q16;
    g->current = (pi_gains_t){p->trim_kp, {mul_q16(g->trim.ki.mant, slow_q16), shift}};
  }
}

// Current over a deviation of the speed, as the EMF line holds the rotor, of k_e / R_t. With all of it the voltage follows the
// reference alone: no delay, no noise of the measured speed. Diodes hold on one side only: what the delay of the speed costs.
static int32_t stiffness_q16(const scheduled_t *g, const six_step_view_t *view, const pwm_t *pwm, uint32_t turns_q16) {
  const parameters_t *p = view->p;
  if (is_firm(view->settings)) {
    // The resistance grows with speed.
    const uint32_t now_q16 = (uint32_t)g->resistance.mant / ((uint32_t)p->resistance_low >> 16) + (uint32_t)p->damping_q16;
    return mul_q16((int32_t)((((uint32_t)ONE_Q16 + (uint32_t)p->damping_q16) << 8) / (now_q16 >> 8)), WHOLE_Q16);
  }
  const int32_t delayed_q16 = (turns_q16 > ONE_Q16) ? (int32_t)(UINT32_MAX / turns_q16) : ONE_Q16;
  return pwm->discontinuous ? mul_q16(delayed_q16, mul_q16(pwm->share_q16, p->discontinuous_q16)) : delayed_q16;
}

// Of a load near the boundary's current dead times take more with each ampere: as a resistance many times the line's,
// with which the EMF holds the rotor that much later.
static bool at_boundary(const regulate_t *r) {
  const int32_t boundary_i_q25 = r->scheduled.boundary.current_i_q25;
  return abs_sat(abs_sat(r->speed_pi.integral_q5 >> PI_INTEGRAL_BITS) - boundary_i_q25) < boundary_i_q25 / 2;
}

// Gains of the speed regulator. The speed is a mean over an electrical turn: where that is long against the bandwidth the
// gains shrink. The integral cancels the rotor's time constant on the EMF line, but is no slower than a quarter of the
// bandwidth.
static void schedule_speed(regulate_t *r, const six_step_view_t *view, const pwm_t *pwm) {
  const parameters_t *p = view->p;
  scheduled_t *g = &r->scheduled;
  const int32_t now_rpm_q8 = scheduled_rpm_q8(r, view);
  const int32_t whole_q16 = clamp_i32(gain_apply(now_rpm_q8, p->speed_bandwidth_scale), 0, PRODUCT_MAX / 2);
  // A mean over three intervals is late by 2 of them, over six by 3.5.
  const uint32_t turns_q16 = (uint32_t)greater(view->m->speed_short ? whole_q16 / 4 * 7 : whole_q16, BANDWIDTH_SCALE_MIN_Q16);
  g->scale_q16 = (turns_q16 < ONE_Q16) ? (int32_t)turns_q16 : ONE_Q16;
  g->lag_q16 = lesser(gain_apply((int32_t)turns_q16, (gain_t){p->speed_lag_q16, 16}), LAG_MAX_Q16);
  const gain_t inertia = {p->speed_kp_inertia, p->speed_kp_shift};
  // Bits of room: the whole of the EMF line is 2.9 times its parameter, and four times that is a gain of the integral.
  const bool firm = is_firm(view->settings);
  const int32_t room = firm ? 4 : 1;
  const int32_t moved = mul_q16(p->speed_kp_inertia, g->scale_q16) >> room;
  const int32_t line_q16 = stiffness_q16(g, view, pwm, turns_q16);
  const int32_t held = firm ? mul_q16(p->speed_kp_stiffness >> room, line_q16) : mul_q16(p->speed_kp_stiffness, line_q16) / 2;
  g->speed.kp = (gain_t){moved + held, p->speed_kp_shift - room};
  const int32_t whole = firm ? greater(moved, 4 * held) : moved + held;
  const int32_t slow = (firm && at_boundary(r)) ? whole / BOUNDARY_SLOWER : whole;
  g->speed.ki = (gain_t){mul_q16(mul_q16(slow, p->speed_wt_q16), g->scale_q16), p->speed_kp_shift - room};
  // Noise of the speed at the lower bound must not become a torque.
  g->noise_i_q25 = gain_apply(view->m->speed_rpm_q8 / SPEED_NOISE, g->speed.kp);
  g->acceleration_i_q25 = gain_apply(view->settings->accel_rpm_q8, inertia);
  g->sector_rpm_q20 = sat_i32(((int64_t)view->m->speed_rpm_q8 * view->m->place_step_q16) >> (4 + SECTOR_UP_SHIFT));
}

// By how much the flux of the file is wrong, from what the current regulator has added while the speed rests and little of it was
// for currents: on a ramp that part grows with the speed.
static void schedule_flux(regulate_t *r, const six_step_view_t *view) {
  const int32_t emf_v_q25 = view->m->emf_v_q25;
  const int32_t drop_v_q25 = gain_apply(abs_sat(view->m->line_i_q25), r->scheduled.resistance);
  const bool rests = abs_sat(r->rotor_rpm_q8 - r->lagged_rpm_q8) < view->m->speed_rpm_q8 / FLUX_REST;
  if (rests && drop_v_q25 < emf_v_q25 / FLUX_LOOK) {
    const int32_t added_v_q25 = clamp_i32(r->current_pi.integral_q5 >> PI_INTEGRAL_BITS, -emf_v_q25, emf_v_q25);
    r->scheduled.flux_q12 = clamp_i32(added_v_q25 * 16 / (emf_v_q25 / 256 + 1), -FLUX_MAX_Q12, FLUX_MAX_Q12);
  }
}

COLD static void schedule(regulate_t *r, const pwm_t *pwm, const six_step_view_t *view, const regulate_input_t *in,
                         uint32_t group) {
  const parameters_t *p = view->p;
  const settings_t *settings = view->settings;
  scheduled_t *g = &r->scheduled;
  const int32_t speed_rpm_q8 = scheduled_rpm_q8(r, view);
  const bool by_speed = group == GROUP_RESISTANCE || group == GROUP_ADVANCE;
  const int32_t ratio_q16 = by_speed ? clamp_i32(gain_apply(speed_rpm_q8, p->speed_ratio), 0, ONE_Q16) : 0;
  switch (group) {
    case GROUP_DUTY:
      schedule_duty_limits(g, view, pwm, in->longest_cycles);
      schedule_flux(r, view);
      break;
    case GROUP_RESISTANCE:
      schedule_resistance(g, view, ratio_q16);
      break;
    case GROUP_CURRENT:
      schedule_current(r, view, pwm);
      break;
    case GROUP_SPEED:
      schedule_speed(r, view, pwm);
      break;
    case GROUP_BOUNDARY:
      schedule_boundary(g, view, pwm);
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
    case GROUP_LEAST:
    default:
      schedule_least(g, view, in->longest_cycles);
      break;
  }
}

HOT static void apply_advance(regulate_t *r, const settings_t *settings) {
  r->advance_q16 = advance_total_q16(settings->advance_q16, r->scheduled.advance_q16);
}

bool regulate_turns_wrong(const settings_t *settings, bool reverse) {
  const int32_t target = settings->target_rpm;
  return target != 0 && (target < 0) != reverse;
}

HOT static regulator_t wanted_regulator(const six_step_view_t *view, bool reverse) {
  const bool torque = view->settings->mode == MODE_TORQUE && view->order->state == STATE_RUNNING &&
                      !regulate_turns_wrong(view->settings, reverse);
  return torque ? REGULATOR_TORQUE : REGULATOR_SPEED;
}

COLD static void ramp_from(regulate_t *r, int32_t speed_rpm_q8) {
  ramp_preset(&r->ramp, speed_rpm_q8);
  r->rotor_rpm_q8 = speed_rpm_q8;
  r->lagged_rpm_q8 = speed_rpm_q8;
  for (uint32_t k = 0; k < SHORT_INTERVALS; k++) {
    r->crossed_rpm_q8[k] = speed_rpm_q8;
  }
}

// Set ramp and integrals so that the present voltage continues.
COLD static void preset(regulate_t *r, const pwm_t *pwm, const six_step_view_t *view) {
  const int32_t speed_rpm_q8 = view->m->speed_rpm_q8;
  const int32_t emf_v_q25 = view->m->emf_v_q25;
  const scheduled_t *g = &r->scheduled;
  r->saturated = 0;
  ramp_from(r, speed_rpm_q8);
  r->limiter.trim_v_q25 = 0;
  const int32_t i_q25 = clamp_i32(view->m->line_i_q25, -r->brake_i_q25, g->limit_i_q25);
  r->reference_i_q25 = i_q25;
  r->expected_i_q25 = i_q25;
  r->flowing_i_q25 = i_q25;
  r->counted_i_q25 = i_q25;
  pi_preset(&r->speed_pi, g->speed.kp, 0, 0, i_q25);
  pi_preset(&r->current_pi, g->current.kp, 0, emf_v_q25 + gain_apply(i_q25, g->resistance), pwm->u_v_q25);
}

void regulate_init(regulate_t *r, const settings_t *settings) { r->advance_q16 = settings->advance_q16; }

static void choose_regulator(regulate_t *r, const six_step_view_t *view, bool reverse) {
  r->regulator = wanted_regulator(view, reverse);
  r->linear = view->settings->linearity;
}

COLD void regulate_prepare(regulate_t *r, const pwm_t *pwm, const six_step_view_t *view, const regulate_input_t *in,
                           uint32_t ticks) {
  choose_regulator(r, view, in->reverse);
  ramp_from(r, view->m->speed_rpm_q8);
  // The groups build on each other in their order.
  schedule(r, pwm, view, in, ticks % SCHEDULE_GROUPS);
}

// Another regulator, or a correction whose factors are not scheduled yet.
COLD static void change_regulator(regulate_t *r, const pwm_t *pwm, const six_step_view_t *view,
                                  const regulate_input_t *in) {
  choose_regulator(r, view, in->reverse);
  schedule(r, pwm, view, in, GROUP_LINEARITY);
  pi_preset(&r->speed_pi, r->scheduled.speed.kp, r->lagged_rpm_q8 - view->m->speed_rpm_q8, 0, r->reference_i_q25);
}

// Diodes cannot give less current than the shortest pulse in which a crossing can be seen: below it the other switch of
// the chopping leg conducts in the gap, and the mean current may be any.
HOT static bool rectifies(const regulate_t *r, const six_step_view_t *view) {
  if (view->settings->sync_rect || view->p->rectify_light == 0) {
    return view->settings->sync_rect;
  }
  const int32_t least_i_q25 = r->scheduled.least_i_q25;
  return r->reference_i_q25 < (r->rectifies ? 2 * least_i_q25 : least_i_q25);
}

HOT static void apply(const regulate_t *r, pwm_t *pwm, const six_step_view_t *view, const regulate_input_t *in,
                      int32_t u_v_q25) {
  const settings_t *settings = view->settings;
  const bool linear = settings->linearity && in->restarts;
  const pwm_demand_t demand = {u_v_q25, r->counted_i_q25, in->longest_cycles, r->scheduled.boundary,
                               linear ? &r->scheduled.linearity : 0, r->scheduled.dead_steep};
  pwm_from_demand(pwm, view, &demand, r->rectifies);
}

COLD void regulate_begin(regulate_t *r, pwm_t *pwm, const six_step_view_t *view, const regulate_input_t *in) {
  r->was_frozen = false;
  r->limit = LIMIT_NONE;
  r->rectifies = view->settings->sync_rect;
  __builtin_memset(&r->pair_emf, 0, sizeof r->pair_emf);
  preset(r, pwm, view);
  apply_advance(r, view->settings);
  apply(r, pwm, view, in, pwm->u_v_q25);
}

void regulate_unload(regulate_t *r) { pi_preset(&r->speed_pi, r->scheduled.speed.kp, 0, 0, 0); }

COLD void regulate_freeze(regulate_t *r) { r->was_frozen = true; }

// Current reference from the speed regulator or the torque target. While the voltage is at a limit, a reference beyond
// what flows could not be followed: it stays near the measured current, and the speed regulator's integral with it.
HOT static void reference_step(regulate_t *r, const six_step_view_t *view, int32_t acceleration_i_q25,
                               int32_t target_rpm_q8) {
  const parameters_t *p = view->p;
  const measured_t *m = view->m;
  const scheduled_t *g = &r->scheduled;
  int32_t high = g->limit_i_q25;
  int32_t low = view->settings->sync_rect ? -r->brake_i_q25 : 0;
  const int32_t room = g->limit_i_q25 / ROOM;
  if (r->saturated > 0) {
    high = clamp_i32(m->line_i_q25 + room, low, high);
  } else if (r->saturated < 0) {
    low = clamp_i32(m->line_i_q25 - room, low, high);
  }
  if (r->regulator == REGULATOR_TORQUE) {
    const gain_t inertia = {p->speed_kp_inertia, p->speed_kp_shift};
    r->ramp.value_rpm_q8 = m->speed_rpm_q8;
    r->rotor_rpm_q8 = m->speed_rpm_q8;
    r->lagged_rpm_q8 = m->speed_rpm_q8;
    r->at_least = false;
    r->reference_i_q25 = torque_reference(view->settings->target_i_q25, inertia, m->speed_rpm_q8, p->stop_rpm * 256,
                                          target_rpm_q8, low, high);
    r->limit = (view->settings->target_i_q25 > high) ? LIMIT_CURRENT : LIMIT_NONE;
    return;
  }
  // While a large error holds the reference at its bound, the integral holds against it; a gain that shrinks with the
  // speed must not let it through.
  const int32_t error = r->lagged_rpm_q8 - m->speed_rpm_q8;
  const int32_t beyond_i_q25 = g->noise_i_q25 + ((error < 0) ? gain_apply(-error, g->speed.kp) / 16 : 0);
  const int32_t integral_q5 = r->speed_pi.integral_q5;
  const pi_result_t i = pi_step(&r->speed_pi, &g->speed, error, acceleration_i_q25, low - beyond_i_q25, high);
  // At a bound the integral waits: what it knows is the load.
  if (is_firm(view->settings) && ((i.output < i.unlimited && error > 0) || (i.output > i.unlimited && error < 0))) {
    r->speed_pi.integral_q5 = integral_q5;
  }
  r->reference_i_q25 = greater(i.output, low);
  r->at_least = i.output <= low;
  r->limit = (i.output < i.unlimited) ? LIMIT_CURRENT : LIMIT_NONE;
  if (i.output > i.unlimited) {
    r->limit = LIMIT_DUTY_MIN;
  }
}

// The current that dead times are counted for. A firm drive's reference swings with a late speed by what does not flow:
// it has to leave the last one by more than the boundary's current, else dead times come and go with it.
HOT static void count_dead_times(regulate_t *r, const six_step_view_t *view) {
  const int32_t play_i_q25 = is_firm(view->settings) ? r->scheduled.boundary.current_i_q25 / 2 * 3 : 0;
  r->counted_i_q25 = clamp_i32(r->counted_i_q25, r->reference_i_q25 - play_i_q25, r->reference_i_q25 + play_i_q25);
}

// Upper bound of the voltage by the currents. One that the slew does not let the voltage reach need not be known: the bound
// is higher than without a margin while there is one.
HOT static int32_t bound_by_current(const regulate_t *r, const limiter_gains_t *gains, int32_t emf_v_q25,
                                    int32_t margin_q17, int32_t reach_v_q25) {
  const int32_t resistive_v_q25 = r->scheduled.resistive_v_q25;
  const int32_t least = emf_v_q25 + resistive_v_q25 + r->limiter.trim_v_q25;
  return (margin_q17 >= 0 && least > reach_v_q25)
             ? least
             : limiter_bound(&r->limiter, gains, emf_v_q25, resistive_v_q25, margin_q17);
}

// Lower bound of the voltage by the braking current. The reference keeps to that current, the bound only near it.
HOT static int32_t braking_bound(const regulate_t *r, const six_step_view_t *view, const limiter_gains_t *gains,
                                 int32_t emf_v_q25) {
  const scheduled_t *g = &r->scheduled;
  const int32_t brake_i_q25 =
      view->settings->sync_rect ? r->brake_i_q25 + r->brake_i_q25 / BRAKE_ROOM : g->limit_i_q25 / ROOM;
  const int32_t margin_q17 = (brake_i_q25 + view->m->line_i_q25) / 256;
  return emf_v_q25 - gain_apply(brake_i_q25, g->resistance) - gain_apply(margin_q17, gains->kp);
}

// Where in a sector the voltage of this tick is applied, one to two ticks from now.
typedef struct {
  uint32_t pair;       // of the middle of that tick
  int32_t y_q16;       // that middle, from the one of the sector, in parts of it
  int32_t beyond_q16;  // what of the tick lies beyond the nearer commutation, in parts of the sector
  int32_t share_q16;   // and of the tick
} spot_t;

SMALL_CODE_BEGIN
static spot_t spot_of(const regulate_t *r, const measured_t *m) {
  // Sectors are as long as the measured speed says: on a steep ramp a mean over the whole turn is late by 3.5 of them.
  const int32_t moved_rpm_q8 = r->rotor_rpm_q8 - r->lagged_rpm_q8;
  const int32_t more_q12 =
      (moved_rpm_q8 != 0 && !m->speed_short) ? clamp_i32(moved_rpm_q8 * 16 / (m->speed_rpm_q8 / 256 + 1), -MOVED_MAX_Q12, MOVED_MAX_Q12) : 0;
  const int32_t step_q16 = m->place_step_q16 + m->place_step_q16 * more_q12 / 4096;
  const int32_t place_q16 = m->place_q16 + m->place_q16 * more_q12 / 4096;
  const int32_t y_q16 = place_q16 + step_q16 * 3 / 2 - ONE_Q16 / 2;
  const bool next = y_q16 > ONE_Q16 / 2;
  spot_t spot = {m->commutations + (next ? 1u : 0u), 0, 0, 0};
  spot.y_q16 = clamp_i32(y_q16 - (next ? ONE_Q16 : 0), -ONE_Q16 / 2, ONE_Q16 / 2);
  const int32_t beyond_q16 = abs_sat(spot.y_q16) + step_q16 / 2 - ONE_Q16 / 2;
  if (beyond_q16 > 0) {
    spot.beyond_q16 = beyond_q16;
    spot.share_q16 = (beyond_q16 << 16) / step_q16;
  }
  return spot;
}

// What the EMF of a sinusoidal pair has more than its mean: at a commutation it turns and rises again.
static int32_t rounding_v_q25(int32_t emf_v_q25, const spot_t *spot) {
  const int32_t cusp_q16 = mul_q16(spot->beyond_q16, spot->share_q16);
  return mul_q16(emf_v_q25, mul_q16(ONE_Q16 / 12 - mul_q16(spot->y_q16, spot->y_q16) + cusp_q16, ROUND_Q16));
}

// The same of this pair beside the others: of unequal fluxes. A sinusoidal pair leans on the flux that it has in common with
// the last one at first, with the next one at last.
static int32_t pair_v_q25(const regulate_t *r, int32_t emf_v_q25, const spot_t *spot, bool sinusoidal) {
  const int32_t own_q20 = r->pair_emf.more_q20[spot->pair % PAIRS];
  const int32_t next_q20 = r->pair_emf.more_q20[(spot->pair + 1u) % PAIRS];
  const int32_t last_q20 = r->pair_emf.more_q20[(spot->pair + 2u) % PAIRS];
  const int32_t other_q20 = ((spot->y_q16 > 0) ? next_q20 : last_q20) - own_q20;
  const int32_t lean_q16 = sinusoidal ? mul_q16(spot->y_q16, LEAN_Q16) : 0;
  const int32_t beyond_q16 = mul_q16(spot->share_q16, sinusoidal ? STEP_Q16 : ONE_Q16);
  return mul_q16(emf_v_q25, own_q20 + mul_q16(next_q20 - last_q20, lean_q16) + mul_q16(other_q20, beyond_q16)) / 16;
}

// Both. Where a sector has only few ticks the inductance evens the EMF out.
__attribute__((noinline)) static int32_t shape_v_q25(const regulate_t *r, const six_step_view_t *view, int32_t emf_v_q25,
                                                     bool by_pair) {
  const bool sinusoidal = view->p->zcd_linear == 0;
  if (!by_pair && view->m->place_step_q16 > ROUND_STEP_MAX_Q16) {
    return 0;
  }
  const spot_t spot = spot_of(r, view->m);
  const int32_t round_v_q25 = sinusoidal ? rounding_v_q25(emf_v_q25, &spot) : 0;
  return round_v_q25 + (by_pair ? pair_v_q25(r, emf_v_q25, &spot, sinusoidal) : 0);
}
SMALL_CODE_END

// Voltage for the reference, between the limits of duty, slew and the currents in both directions. While diodes end the
// current of each carrier the reference alone gives the pulse, and the measured current says nothing of the EMF.
HOT static int32_t voltage_step(regulate_t *r, const pwm_t *pwm, const six_step_view_t *view) {
  const parameters_t *p = view->p;
  const measured_t *m = view->m;
  const settings_t *s = view->settings;
  const scheduled_t *g = &r->scheduled;
  const limiter_gains_t gains = {p->limiter_kp, p->limiter_ki};
  const int32_t mean_v_q25 = emf_now_v_q25(r, view);
  const bool by_pair = m->place_step_q16 <= ROUND_STEP_MAX_FIRM_Q16 && is_firm(view->settings);
  const int32_t more_v_q25 = shape_v_q25(r, view, mean_v_q25, by_pair);
  const int32_t emf_v_q25 = mean_v_q25 + more_v_q25;
  // The integral knows by how much the EMF is wrong: of flux and temperature.
  const int32_t trimmed_v_q25 = emf_v_q25 + (r->current_pi.integral_q5 >> PI_INTEGRAL_BITS);
  // The magnitude of a braking current has its own limit.
  const int32_t motor_q17 = (m->idc_q17 >= 0) ? m->motor_q17 : 0;
  const int32_t margin_q17 = lesser(g->limit_i_q25 / 256 - motor_q17, s->dc_limit_q17 - m->idc_q17);
  const int32_t high_current = bound_by_current(r, &gains, trimmed_v_q25, margin_q17, pwm->u_v_q25 + p->slew_v_q25);
  const int32_t floor_v_q25 = lesser(r->rectifies ? g->low_v_q25 : emf_v_q25 / 2, g->high_v_q25);
  const int32_t least =
      r->rectifies ? clamp_i32(braking_bound(r, view, &gains, trimmed_v_q25), floor_v_q25, g->high_v_q25) : floor_v_q25;
  const int32_t most = clamp_i32(high_current, least, g->high_v_q25);
  const int32_t high = clamp_i32(pwm->u_v_q25 + p->slew_v_q25, least, most);
  const int32_t low = clamp_i32(pwm->u_v_q25 - p->slew_v_q25, least, high);
  // At its lower bound the reference does not answer to the speed.
  const pi_gains_t *current = (r->at_least && r->rectifies) ? &g->trim : &g->current;
  // The reference as the filter of the measured current would show it, and as the inductance lets it rise: else the integral
  // takes their lags for an error.
  r->expected_i_q25 += (r->reference_i_q25 - r->expected_i_q25) >> p->loop_filter_shift;
  const int32_t follows_q16 = is_firm(view->settings) ? lesser(2 * p->ramp_end_q16, ONE_Q16) : ONE_Q16;
  r->flowing_i_q25 += mul_q16(r->expected_i_q25 - r->flowing_i_q25, follows_q16);
  const int32_t error = pwm->discontinuous ? 0 : r->flowing_i_q25 - m->line_i_q25;
  const int32_t ahead_i_q25 = pwm->discontinuous ? 0 : r->expected_i_q25 - r->flowing_i_q25;
  const int32_t integral_q5 = r->current_pi.integral_q5;
  const int32_t forward_v_q25 = emf_v_q25 + gain_apply(r->reference_i_q25, g->resistance) + gain_apply(ahead_i_q25, current->kp);
  const pi_result_t u = pi_step(&r->current_pi, current, error, forward_v_q25, floor_v_q25, g->high_v_q25);
  const int32_t output = clamp_i32(u.output, low, high);
  const bool above = output < u.unlimited && high == most;
  const bool below = output > u.unlimited && low == least;
  // The bounds by current go with the integral: led by them it would run away. The slew holds it.
  if ((output < u.unlimited && error > 0 && !above) || (output > u.unlimited && error < 0)) {
    r->current_pi.integral_q5 = integral_q5;
  }
  r->saturated = 0;
  if (above && most == g->high_v_q25) {
    r->saturated = 1;
    r->limit = LIMIT_DUTY_MAX;
  } else if (above) {
    r->limit = LIMIT_CURRENT;
  } else if (below && r->rectifies) {
    r->saturated = (least == g->low_v_q25) ? -1 : 0;
    r->limit = r->saturated != 0 ? LIMIT_DUTY_MIN : LIMIT_CURRENT;
  } else if (output != u.unlimited && !pwm->discontinuous) {
    r->limit = LIMIT_SLEW;
  }
  limiter_update(&r->limiter, &gains, g->resistive_v_q25, margin_q17, above);
  if (by_pair) {
    const pair_emf_gains_t pair = {{p->resistance_low, p->resistance_shift + 8}, p->pair_inductance, p->pair_spring};
    pair_emf_step(&r->pair_emf, &pair, output - more_v_q25, mean_v_q25, m->line_i_q25, p->loop_filter_shift,
                  m->commutations);
  } else {
    pair_emf_pause(&r->pair_emf);
  }
  return output;
}

static int32_t ending_rpm_q20(int32_t left_rpm_q8, int32_t share_q16) {
  return sat_i32(((int64_t)abs_sat(left_rpm_q8) * share_q16) >> 4);
}

// The current of a smaller step.
static int32_t part_i_q25(int32_t current_i_q25, int32_t less_rpm_q20, int32_t step_rpm_q20) {
  return mul_q16(current_i_q25, less_rpm_q20 / ((step_rpm_q20 >> 12) + 1) * 16);
}

// A step of the ramp, no steeper than what the load leaves of the current can do. Returns the current that it needs.
HOT static int32_t follow_target(regulate_t *r, const six_step_view_t *view, int32_t target_rpm_q8) {
  const parameters_t *p = view->p;
  const scheduled_t *g = &r->scheduled;
  const int32_t load_i_q25 = r->speed_pi.integral_q5 >> PI_INTEGRAL_BITS;
  const bool up = target_rpm_q8 > r->ramp.value_rpm_q8;
  // A load fades as the rotor slows down: half of it helps to brake. Without braking the rotor coasts, and the ramp waits.
  const int32_t down_i_q25 = view->settings->sync_rect ? r->brake_i_q25 + load_i_q25 / 2 : g->limit_i_q25;
  const int32_t room_i_q25 = up ? g->limit_i_q25 - load_i_q25 : down_i_q25;
  // By the slope of now: what it needs in current follows some ticks after a change of the setting.
  const int32_t most_i_q25 = clamp_i32(room_i_q25, g->limit_i_q25 / ROOM_MIN, g->limit_i_q25);
  // A product holds 512 r/min with 20 bits of fraction, a step may have 2048.
  const int32_t most_rpm_q20 = sat_i32((int64_t)gain_apply(most_i_q25, p->current_accel) * 4);
  int32_t step_rpm_q20 = view->settings->accel_rpm_q20;
  int32_t current_i_q25 = g->acceleration_i_q25;
  if (most_rpm_q20 < step_rpm_q20) {
    step_rpm_q20 = most_rpm_q20;
    current_i_q25 = most_i_q25;
  }
  const int32_t sector_rpm_q20 = up ? g->sector_rpm_q20 : sat_i32((int64_t)g->sector_rpm_q20 * SECTOR_DOWN);
  const int32_t crossed_rpm_q20 = greater(sector_rpm_q20, RAMP_STEP_MIN_Q20);
  if (crossed_rpm_q20 < step_rpm_q20) {
    current_i_q25 = part_i_q25(current_i_q25, crossed_rpm_q20, step_rpm_q20);
    step_rpm_q20 = crossed_rpm_q20;
  }
  const int32_t before_rpm_q8 = r->ramp.value_rpm_q8;
  // The current needs its time to fall: toward its end the ramp is as slow as that.
  const int32_t last_rpm_q20 = is_firm(view->settings) ? ending_rpm_q20(target_rpm_q8 - before_rpm_q8, p->ramp_end_q16) : INT32_MAX;
  if (last_rpm_q20 < step_rpm_q20) {
    current_i_q25 = part_i_q25(current_i_q25, last_rpm_q20, step_rpm_q20);
    step_rpm_q20 = greater(last_rpm_q20, RAMP_STEP_MIN_Q20);
  }
  const int32_t direction =
      ramp_step(&r->ramp, target_rpm_q8, step_rpm_q20, speed_now_rpm_q8(r, view->m), p->ramp_window_rpm * 256);
  return current_i_q25 * direction;
}

// The shortest pulse drives the rotor ahead of the ramp: it goes on from there.
COLD static void go_on_from_rotor(regulate_t *r, const measured_t *m) {
  ramp_from(r, m->speed_rpm_q8);
  pi_preset(&r->speed_pi, r->scheduled.speed.kp, 0, 0, greater(m->line_i_q25, 0));
}

// The current needs its time to rise: the rotor follows the ramp by so much later. What the trim has found of a wrong flux goes
// along with it.
HOT static void lead_rotor(regulate_t *r, const six_step_view_t *view) {
  const int32_t behind_rpm_q8 = r->ramp.value_rpm_q8 - r->rotor_rpm_q8;
  if (behind_rpm_q8 == 0 || !is_firm(view->settings)) {
    r->rotor_rpm_q8 = r->ramp.value_rpm_q8;
    return;
  }
  const int32_t share_rpm_q8 = mul_q16(behind_rpm_q8, lesser(2 * view->p->ramp_end_q16, ONE_Q16));
  const int32_t step_rpm_q8 = (share_rpm_q8 != 0) ? share_rpm_q8 : (behind_rpm_q8 > 0) ? 1 : -1;
  r->rotor_rpm_q8 += step_rpm_q8;
  const int32_t added_v_q25 = gain_apply(step_rpm_q8, view->p->emf);
  pi_shift(&r->current_pi, (int32_t)(((int64_t)added_v_q25 * r->scheduled.flux_q12) >> 12));
}

// The ramp as the measured speed shows it: its mean over the same three intervals, of its values at their ends. A lag stands
// for a mean over the whole turn.
HOT static void follow_ramp(regulate_t *r, const measured_t *m) {
  const int32_t now_rpm_q8 = r->rotor_rpm_q8;
  int32_t *at = r->crossed_rpm_q8;
  if (!m->speed_short) {
    r->lagged_rpm_q8 += mul_q16(now_rpm_q8 - r->lagged_rpm_q8, r->scheduled.lag_q16);
  } else if (m->speed_fresh) {
    r->lagged_rpm_q8 = at[0] + mul_q16((now_rpm_q8 - at[0]) + 2 * (at[1] - at[0]) + (at[2] - at[0]), ONE_Q16 / 6);
  }
  if (m->speed_fresh) {
    at[2] = at[1];
    at[1] = at[0];
    at[0] = now_rpm_q8;
  }
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
  // At most every second tick, and not in one that divides for a new speed or looks after the machine.
  r->schedule_skipped = in->busy || m->speed_fresh || !r->schedule_skipped;
  if (!r->schedule_skipped) {
    schedule(r, pwm, view, in, r->schedule_group);
    r->schedule_group = (r->schedule_group + 1u) % SCHEDULE_GROUPS;
  }
  if (settings->sync_rect) {
    r->brake_i_q25 =
        brake_current(r->brake_i_q25, settings->brake_limit_i_q25, m->vdc_v_q25, p->brake_vdc_v_q25, p->brake_range);
  }
  if (r->saturated < 0 && m->speed_rpm_q8 > r->ramp.value_rpm_q8 && target_rpm_q8 > m->speed_rpm_q8) {
    go_on_from_rotor(r, m);
  }
  const int32_t acceleration_i_q25 = follow_target(r, view, target_rpm_q8);
  lead_rotor(r, view);
  follow_ramp(r, m);
  reference_step(r, view, acceleration_i_q25, target_rpm_q8);
  count_dead_times(r, view);
  r->rectifies = rectifies(r, view);
  apply(r, pwm, view, in, voltage_step(r, pwm, view));
  if (pwm->at_least) {
    r->limit = LIMIT_DUTY_MIN;
  }
}

bool regulate_nearly_stopped(const regulate_t *r, const six_step_view_t *view) {
  const int32_t stop_rpm = view->p->stop_rpm;
  const int32_t speed_rpm_q8 = scheduled_rpm_q8(r, view);
  const bool held = view->settings->sync_rect && view->m->emf_v_q25 < r->scheduled.low_v_q25 / 4 * 5;
  return speed_rpm_q8 < stop_rpm * 256 + stop_rpm * 16 || held;
}
