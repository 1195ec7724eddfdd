#include "drive/run.h"

#include "control/carrier.h"
#include "control/placement.h"

#define ONE_Q16 65536
// The least duty grows with speed; at most this.
#define LEAST_DUTY_MAX_Q16 26214
// Least share of the gains at low speed.
#define BANDWIDTH_SCALE_MIN_Q16 4096

// Quantities that follow speed and DC-link voltage slowly are renewed one group a tick.
#define SCHEDULE_GROUPS 4u

static int32_t interpolate(int32_t low, int32_t high, int32_t ratio_q16) {
  return low + mul_q16(high - low, ratio_q16);
}

static int32_t diode_v_q25(const drive_t *drive) { return drive->settings.sync_rect ? 0 : drive->p->diode_v_q25; }

static int32_t lesser(int32_t a, int32_t b) { return (a < b) ? a : b; }
static int32_t greater(int32_t a, int32_t b) { return (a > b) ? a : b; }

HOT static void schedule(drive_t *drive, uint32_t group) {
  const parameters_t *p = drive->p;
  scheduled_t *g = &drive->scheduled;
  const int32_t speed_rpm_q8 = drive->m.speed_rpm_q8;
  if (group == 0u) {
    const int32_t diode = diode_v_q25(drive);
    const uint32_t least_q16 = ((uint32_t)p->least_on_cycles << 16) / drive->m.longest_cycles;
    const int32_t least_q30 = (least_q16 < LEAST_DUTY_MAX_Q16) ? (int32_t)(least_q16 << 14) : LEAST_DUTY_MAX_Q16 << 14;
    g->low_v_q25 = voltage_from_duty_v_q25(least_q30, drive->m.vdc_v_q25, diode);
    g->high_v_q25 = voltage_from_duty_v_q25(p->duty_max_q30, drive->m.vdc_v_q25, diode);
    return;
  }
  const int32_t ratio_q16 = clamp_i32(gain_apply(speed_rpm_q8, p->speed_ratio), 0, ONE_Q16);
  if (group == 1u) {
    const gain_t resistance = {interpolate(p->resistance_low, p->resistance_high, ratio_q16), p->resistance_shift};
    // The DC-link current is the machine's current times the duty.
    const uint32_t duty_q14 = ((uint32_t)drive->duty_q30 >> 16) + 1u;
    const uint32_t dc_as_motor_q17 = ((uint32_t)drive->settings.dc_limit_q17 << 14) / duty_q14;
    const uint32_t limit_q17 = (uint32_t)drive->settings.current_limit_q17;
    g->resistive_v_q25 =
        gain_apply((int32_t)((dc_as_motor_q17 < limit_q17) ? dc_as_motor_q17 : limit_q17), resistance);
    return;
  }
  const int32_t scale_q16 =
      clamp_i32(gain_apply(speed_rpm_q8, p->speed_bandwidth_scale), BANDWIDTH_SCALE_MIN_Q16, ONE_Q16);
  if (group == 2u) {
    g->kp_full = (gain_t){interpolate(p->speed_kp_low, p->speed_kp_high, ratio_q16), p->speed_kp_shift};
    g->pi.kp = (gain_t){mul_q16(g->kp_full.mant, scale_q16), p->speed_kp_shift};
    // More than the current limit allows would only be unwound again by the integral.
    g->acceleration_v_q25 = lesser(gain_apply(drive->settings.accel_rpm_q8, g->kp_full), g->resistive_v_q25);
  } else {
    const int32_t ki = interpolate(p->speed_ki_low, p->speed_ki_high, ratio_q16);
    g->pi.ki = (gain_t){mul_q16(ki, scale_q16), p->speed_ki_shift};
  }
}

// Without synchronous rectification nothing brakes: below half of the EMF the pulses carry next to no current, less
// voltage slows the rotor no faster. All of the voltage below the EMF has to be regained when the target is reached,
// and the rotor falls on meanwhile: so the nearer the target, the nearer to the EMF.
HOT static int32_t lower_limit_v_q25(const drive_t *drive, int32_t reference_v_q25) {
  if (drive->settings.sync_rect) {
    return drive->scheduled.low_v_q25;
  }
  const int32_t emf_v_q25 = gain_apply(drive->m.speed_rpm_q8, drive->p->emf);
  const int32_t depth_v_q25 = clamp_i32(4 * (emf_v_q25 - reference_v_q25), emf_v_q25 / 8, emf_v_q25 / 2);
  return greater(drive->scheduled.low_v_q25, emf_v_q25 - depth_v_q25);
}

// Settings that the console may change while running.
HOT static void apply_settings(drive_t *drive) {
  const settings_t *s = &drive->settings;
  drive->command.commutation = s->commutation;
  drive->command.pattern = s->pattern;
  drive->command.advance_q16 = s->advance_q16;
}

// Set gains, ramp and integral so that the present voltage continues.
COLD static void preset(drive_t *drive) {
  const int32_t speed_rpm_q8 = drive->m.speed_rpm_q8;
  for (uint32_t group = 0; group < SCHEDULE_GROUPS; group++) {
    schedule(drive, group);
  }
  ramp_preset(&drive->ramp, speed_rpm_q8);
  pi_preset(&drive->speed_pi, drive->scheduled.pi.kp, 0, gain_apply(speed_rpm_q8, drive->p->emf), drive->u_v_q25);
  drive->limiter.trim_v_q25 = 0;
}

COLD void run_begin(drive_t *drive) {
  drive_enter(drive, STATE_RUNNING);
  drive->was_frozen = false;
  drive->command.force_on_miss = true;
  drive->command.timeout_q12 = (uint32_t)drive->p->timeout_q12;
  preset(drive);
  apply_settings(drive);
  drive_apply_voltage(drive, drive->u_v_q25, drive->settings.sync_rect);
}

HOT void run_step(drive_t *drive, int32_t target_rpm_q8) {
  if (drive->settings.freeze && drive->state == STATE_RUNNING) {
    drive->was_frozen = true;
    return;
  }
  if (drive->was_frozen) {
    drive->was_frozen = false;
    preset(drive);
  }
  const parameters_t *p = drive->p;
  const measured_t *m = &drive->m;
  const settings_t *s = &drive->settings;
  const scheduled_t *g = &drive->scheduled;
  apply_settings(drive);
  schedule(drive, drive->tick % SCHEDULE_GROUPS);

  const int32_t direction = ramp_step(&drive->ramp, target_rpm_q8, s->accel_rpm_q24, m->speed_rpm_q8,
                                      p->ramp_window_rpm * 256);
  const int32_t reference = drive->ramp.value_rpm_q8;
  const int32_t reference_v_q25 = gain_apply(reference, p->emf);
  const int32_t feed_forward = reference_v_q25 + direction * g->acceleration_v_q25;

  const limiter_gains_t limiter_gains = {p->limiter_kp, p->limiter_ki};
  const int32_t margin_q17 = lesser(s->current_limit_q17 - m->motor_q17, s->dc_limit_q17 - m->idc_q17);
  const int32_t high_current = limiter_bound(&drive->limiter, &limiter_gains, gain_apply(m->speed_rpm_q8, p->emf),
                                             g->resistive_v_q25, margin_q17);
  // The least duty keeps the crossings visible and stands above the current limit.
  const int32_t high = greater(lesser(g->high_v_q25, high_current), g->low_v_q25);
  const int32_t low = lesser(lower_limit_v_q25(drive, reference_v_q25), high);
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
  drive_apply_voltage(drive, output, drive->settings.sync_rect);
}
