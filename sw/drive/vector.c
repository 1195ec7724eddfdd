// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "drive/vector.h"

#include "control/brake.h"
#include "control/fixed.h"
#include "control/mtpa.h"
#include "control/placement.h"
#include "control/speed.h"
#include "control/trig.h"
#include "control/vector_speed.h"
#include "drive/protect.h"
#include "drive/start.h"
#include "drive/vector_injection.h"
#include "drive/vector_parts.h"

#define ONE_OVER_SQRT3_Q16 37837
#define HALF_PI_Q30 1686629713
// Turns below it, 1.4 degrees: two terms of the series are enough.
#define SMALL_TURN_Q32 (1 << 24)
#define SCALE_BITS 17u
#define SCALE_SHIFT_MAX 31
#define REST_PARTS 64

// The slow protection is for the core's load slower than the groups.
#define PROTECT_TICKS (16u * VECTOR_GROUPS)

enum { GROUP_SPEED, GROUP_FIELD, GROUP_LIMITS, GROUP_SUPERVISION };

static int32_t current_limit_i_q25(const drive_t *drive) { return drive->settings.current_limit_q17 * 256; }

// The target asks for the other direction, or for none.
HOT static bool descending(const drive_t *drive) {
  return drive->state == STATE_STOPPING || (drive->settings.target_rpm < 0 && drive->vector.direction > 0) ||
         (drive->settings.target_rpm > 0 && drive->vector.direction < 0);
}

// 1 / count, which seldom changes.
HOT static int32_t share_of(share_t *share, uint32_t count) {
  if (count != share->count) {
    share->count = count;
    share->share_q30 = (int32_t)((uint32_t)ONE_Q30 / count);
  }
  return share->share_q30;
}

HOT static int32_t share(int32_t sum, int32_t share_q30) {
  return (int32_t)(((int64_t)sum * share_q30 + ONE_Q30 / 2) >> 30);
}

// Only what the step before asked for. Ticks that follow the samples cannot miss them.
HOT static void measure(drive_t *drive, const chip_snapshot_t *in) {
  measured_t *m = &drive->m;
  drive->vector.angle_turn_q32 = in->vector.theta_sample_q32;
  m->silent_ticks = (in->sample_number == m->last_sample) ? m->silent_ticks + 1u : 0u;
  m->last_sample = in->sample_number;
  if (in->sum_count > 0u) {
    const int32_t share_q30 = share_of(&drive->vector.sums, in->sum_count);
    m->vdc_v_q25 = clamp_i32(share(in->vdc_sum_q17, share_q30), 0, SAMPLE_MAX_Q17) * 256;
    const int32_t idc_q17 = clamp_i32(share(in->idc_sum_q17, share_q30), -FULL_Q17, SAMPLE_MAX_Q17);
    m->idc_mean_q17 = idc_q17;
    m->idc_filter_q25 += (idc_q17 * 256 - m->idc_filter_q25) >> drive->p->current_filter_shift;
    m->idc_q17 = m->idc_filter_q25 >> 8;
  }
}

HOT static int32_t share_v_q25(int32_t sum_v_q17, int32_t share_q30) {
  return (int32_t)(((int64_t)sum_v_q17 * share_q30 + (1 << 21)) >> 22);
}

// Mean of the voltages that acted since the last tick, the first of which came before it, the newest not being among
// them. The observer kept that first one.
HOT static complex_t mean_voltage_v_q25(vector_t *v, const chip_vector_snapshot_t *in) {
  const int32_t share_q30 = share_of(&v->steps, (in->steps > 0u) ? in->steps : 1u);
  const complex_t first_v_q17 = to_q17(v->observer.voltage_v_q25);
  const complex_t sum = complex_sub(complex_add(in->v_sum_q17[0], first_v_q17), in->v_q17[0]);
  return (complex_t){share_v_q25(sum.re, share_q30), share_v_q25(sum.im, share_q30)};
}

// The regulator's state is the voltage without what goes forward.
HOT static complex_t acting_v_q25(const drive_t *drive, const chip_vector_snapshot_t *in) {
  const complex_t forward_v_q17 = drive->vector.forward_v_q17;
  const complex_t forward_v_q25 = {forward_v_q17.re * 256, forward_v_q17.im * 256};
  return complex_add(complex_add(in->u_v_q25[0], forward_v_q25), drive->vector.late_v_q25);
}

INLINED static void observe(drive_t *drive, const chip_vector_snapshot_t *in) {
  vector_t *v = &drive->vector;
  const emf_observer_gains_t *gains = &v->design[v->used].observer;
  if (drive->p->vector_tick_samples > 1) {
    emf_observer_voltage(&v->observer, gains, complex_add(mean_voltage_v_q25(v, in), v->late_v_q25));
    emf_observer_step(&v->observer, gains, in->i_q17[0]);
    v->observer.voltage_v_q25 = (complex_t){in->v_q17[0].re * 256, in->v_q17[0].im * 256};
  } else {
    emf_observer_step(&v->observer, gains, in->i_q17[0]);
    emf_observer_voltage(&v->observer, gains, acting_v_q25(drive, in));
  }
  if (!in->taken) {
    return;
  }
  const int32_t turn_q32 = v->correct_q32;
  if (turn_q32 >= -SMALL_TURN_Q32 && turn_q32 <= SMALL_TURN_Q32) {
    const int32_t turn_rad_q30 = mul_high_i32(turn_q32 * 4, HALF_PI_Q30);
    emf_observer_turn_small(&v->observer, turn_rad_q30);
  } else {
    const complex_t rotation = rotation_q30(turn_q32);
    emf_observer_turn(&v->observer, rotation);
  }
  v->forward_v_q17 = drive->command.vector.forward_v_q17[0];
  v->frame_turn_q32 += (uint32_t)turn_q32;
  v->correct_q32 = 0;
  v->holding = false;
}

// Of a drive with injection; the control step without one has its own copy.
SHARED void vector_observe(drive_t *drive, const chip_vector_snapshot_t *in) { observe(drive, in); }

HOT static void read_encoder(drive_t *drive, const chip_vector_snapshot_t *in) {
  vector_t *v = &drive->vector;
  v->encoder_turn_q32 = encoder_turn_q32(&v->encoder_settings, in->encoder_position, v->speed_turn_q36);
  if (in->encoder_indexed) {
    v->encoder_offset_q32 = (uint32_t)drive->p->encoder_offset_q32;
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

HOT static void speed_regulator(drive_t *drive, bool limited) {
  vector_t *v = &drive->vector;
  const int32_t limit = current_limit_i_q25(drive);
  const int32_t rest = current_rest(v, limit);
  int32_t driving = rest;
  if (limited) {
    // A voltage at its limit cannot drive more current than flows.
    const int32_t reached = abs_sat(v->current_i_q17.im) * 256 + limit / 8;
    driving = (reached < rest) ? reached : rest;
  }
  // Near standstill braking feeds nothing back.
  const bool crawling = v->sensored && v->speed_turn_q36 * v->direction < drive->p->vector_back_turn_q36;
  const int32_t braking = (drive->brake_i_q25 < rest && !crawling) ? drive->brake_i_q25 : rest;
  const int32_t high = (v->direction > 0) ? driving : braking;
  const int32_t low = (v->direction > 0) ? -braking : -driving;
  const int32_t wanted = gain_apply(drive->ramp.value_rpm_q8, drive->p->vector_rpm_to_turn);
  const pi_result_t i = pi_step(&v->speed, &v->speed_gains, wanted - v->speed_turn_q36, 0, low, high);
  drive->limit = limited ? LIMIT_DUTY_MAX : ((i.output != i.unlimited) ? LIMIT_CURRENT : LIMIT_NONE);
  v->reference_i_q25.im = i.output;
  if (drive->p->vector_mtpa_ratio_i_q25 != 0) {
    const complex_t split = mtpa_current_i_q25(i.output, drive->p->vector_mtpa_ratio_i_q25);
    v->mtpa_i_q25 = split.re;
    v->reference_i_q25.im = split.im;
  }
}

HOT static void weaken_field(drive_t *drive, complex_t voltage_v_q25) {
  const parameters_t *p = drive->p;
  const int32_t limit_v_q25 = (int32_t)drive->command.vector.limit_v_q17[0] * 256;
  const field_weakening_settings_t settings = {
      .ki = drive->vector.weakening_ki,
      .wanted_v_q25 = mul_q16(limit_v_q25, p->vector_weakening_share_q16),
      .lowest_i_q25 = p->vector_weakening_lowest_i_q25,
  };
  const int32_t highest = drive->vector.mtpa_i_q25;
  (void)field_weakening_step(&drive->vector.weakening, &settings, voltage_v_q25,
                             (highest > settings.lowest_i_q25) ? highest : settings.lowest_i_q25);
}

// Voltage circle and the modulator's scale for the DC link of now, braking current.
HOT static void apply_limits(drive_t *drive) {
  const parameters_t *p = drive->p;
  chip_vector_command_t *command = &drive->command.vector;
  const int32_t vdc = drive->m.vdc_v_q25;
  const int32_t circle_v_q25 = mul_q16(mul_q16(vdc, ONE_OVER_SQRT3_Q16), p->vector_circle_q16);
  command->limit_v_q17[0] = (uint32_t)clamp_i32(circle_v_q25 >> 8, 0, SAMPLE_MAX_Q17);
  drive->brake_i_q25 = brake_current(drive->brake_i_q25, drive->settings.brake_limit_i_q25, vdc, p->brake_vdc_v_q25,
                                     p->brake_range);
  command->write_limits = true;
  command->lead_q32 = vector_lead_turn_q32(&drive->vector.plant.machine, drive->vector.speed_turn_q36);
  if (vector_injects(drive)) {
    vector_injection_limits(drive);
  }
  // scale = mant 2^-shift / vdc, to 15 bits or more; the measured voltage has 17. Rounded down: a voltage is never too
  // large by it.
  const uint32_t vdc_q17 = (vdc > 256) ? (uint32_t)vdc >> 8 : 1u;
  uint32_t scale = ((uint32_t)p->vector_scale_v.mant << 1) / vdc_q17;
  int32_t shift = p->vector_scale_v.shift + 9;
  while (scale >> SCALE_BITS != 0u || shift > SCALE_SHIFT_MAX) {
    scale >>= 1;
    shift--;
  }
  command->scale = scale;
  command->scale_shift = (uint32_t)((shift > 1) ? shift : 1);
}

// Observed and encoder angle side by side, steps that the encoder lost.
HOT static void compare_angles(drive_t *drive, const chip_vector_snapshot_t *in) {
  vector_t *v = &drive->vector;
  v->observed_ahead_q30 = v->sensored ? pll_error_q30(v->observer.emf_v_q25, v->speed_turn_q36,
                                                      v->start_settings.minimum_v_q25)
                                      : v->error_q30;
  v->encoder_ahead_q30 = has_encoder(drive) ? encoder_error_q30(encoder_angle_q32(v), v->frame_turn_q32) : 0;
  v->encoder_faults += (uint16_t)(in->encoder_invalid - v->encoder_invalid);
  v->encoder_invalid = in->encoder_invalid;
}

// Does the EMF belong to the speed, and does its angle hold still?
HOT static void check_lock(drive_t *drive, complex_t voltage_v_q25) {
  vector_t *v = &drive->vector;
  const int32_t speed = v->speed_turn_q36 * v->direction;
  v->emf_v_q25 = rough_length(v->observer.emf_v_q25);
  v->state_v_q25 = voltage_v_q25;
  const uint32_t expected = (uint32_t)abs_sat(gain_apply(speed, drive->p->vector_flux));
  const bool weak = v->emf_v_q25 < expected / 2u || speed < drive->p->vector_back_turn_q36 / 2;
  // A rotor that turns while its encoder stands still.
  const uint32_t most = expected + (v->sensored ? v->start_settings.minimum_v_q25 : 0u);
  const bool bad = abs_sat(v->error_q30) > LOST_ERROR_Q30 || v->emf_v_q25 / 2u > most || (weak && !v->sensored);
  v->suspicion = bad ? v->suspicion + 1u : 0u;
}

HOT static void track(drive_t *drive, bool taken) {
  vector_t *v = &drive->vector;
  // A correction that has not been taken yet is still in the error.
  v->error_q30 = 0;
  if (taken && v->sensored) {
    v->error_q30 = encoder_error_q30(encoder_angle_q32(v), v->frame_turn_q32);
  } else if (taken) {
    v->error_q30 = pll_error_from_q30(v->observer.emf_v_q25, v->speed_turn_q36, v->start_settings.minimum_v_q25,
                                      &v->emf_reciprocal);
  }
  const int32_t correct_q32 = pll_correct(&v->pll, &v->pll_gains, v->error_q30);
  v->correct_q32 = taken ? correct_q32 : v->correct_q32;
  v->speed_turn_q36 = pll_speed_turn_q36(&v->pll);
}

// Speed, its reference, the reference of i_q and the goal of i_d.
HOT static void regulate_speed(drive_t *drive, const chip_snapshot_t *in) {
  vector_t *v = &drive->vector;
  const parameters_t *p = drive->p;
  const bool down = descending(drive);
  const int32_t target_rpm_q8 =
      clamp_i32(abs_sat(drive->settings.target_rpm) * 256, v->least_rpm_q8, p->speed_max_rpm * 256);
  const int32_t step_rpm_q20 = clamp_i32(drive->settings.accel_rpm_q20, 1, INT32_MAX / (int32_t)VECTOR_GROUPS);
  drive->m.speed_rpm_q8 = rpm_q8(drive, v->speed_turn_q36);
  (void)ramp_step(&drive->ramp, v->direction * (down ? v->back_rpm_q8 : target_rpm_q8),
                  step_rpm_q20 * (int32_t)VECTOR_GROUPS, drive->m.speed_rpm_q8, p->ramp_window_rpm * 256);
  speed_regulator(drive, in->vector.limited[0]);
  const int32_t speed_rpm_q8 = v->direction * drive->m.speed_rpm_q8;
  const bool slow = down && speed_rpm_q8 < v->handover_rpm_q8;
  v->goal_i_q25 = slow ? p->vector_start_i_q25 : v->weakening.current_i_q30 >> 5;
  if (speed_rpm_q8 / 256 > p->overspeed_rpm) {
    drive_enter_fault(drive, FAULT_OVERSPEED);
  } else if (slow && v->reference_i_q25.re == v->goal_i_q25 && speed_rpm_q8 <= v->back_rpm_q8 + v->back_rpm_q8 / 16) {
    vector_hand_back(drive, in);
  }
}

// With an encoder: the target's sign is taken through zero, zero is a target.
HOT static void regulate_sensored(drive_t *drive, const chip_snapshot_t *in) {
  vector_t *v = &drive->vector;
  const parameters_t *p = drive->p;
  const bool stopping = drive->state == STATE_STOPPING;
  const int32_t step_rpm_q20 = clamp_i32(drive->settings.accel_rpm_q20, 1, INT32_MAX / (int32_t)VECTOR_GROUPS);
  v->direction = (v->speed_turn_q36 < 0) ? -1 : 1;
  drive->m.speed_rpm_q8 = rpm_q8(drive, v->speed_turn_q36);
  (void)ramp_step(&drive->ramp, stopping ? 0 : drive->settings.target_rpm * 256, step_rpm_q20 * (int32_t)VECTOR_GROUPS,
                  drive->m.speed_rpm_q8, p->ramp_window_rpm * 256);
  speed_regulator(drive, in->vector.limited[0]);
  v->goal_i_q25 = v->weakening.current_i_q30 >> 5;
  const int32_t speed_rpm_q8 = abs_sat(drive->m.speed_rpm_q8);
  if (speed_rpm_q8 / 256 > p->overspeed_rpm) {
    drive_enter_fault(drive, FAULT_OVERSPEED);
  } else if (stopping && drive->ramp.value_rpm_q8 == 0 && speed_rpm_q8 < v->back_rpm_q8 / 16) {
    drive_gates_off(drive);
    drive_enter(drive, STATE_READY);
  }
}

HOT static void observed_step(drive_t *drive, const chip_snapshot_t *in) {
  vector_t *v = &drive->vector;
  const parameters_t *p = drive->p;
  track(drive, in->vector.taken);
  if (drive->state == STATE_STARTING) {
    drive_enter(drive, STATE_RUNNING);
  }
  v->reference_i_q25.re = fade(v->reference_i_q25.re, v->goal_i_q25, p->vector_fade_i_q25);
  switch (drive->tick % VECTOR_GROUPS) {
    case GROUP_SPEED:
      if (v->sensored) {
        regulate_sensored(drive, in);
      } else {
        regulate_speed(drive, in);
      }
      break;
    case GROUP_FIELD:
      if (p->vector_weakening_lowest_i_q25 < 0) {
        weaken_field(drive, in->vector.u_v_q25[0]);
      } else {
        v->weakening.current_i_q30 = v->mtpa_i_q25 * 32;
      }
      break;
    case GROUP_SUPERVISION:
      check_lock(drive, in->vector.u_v_q25[0]);
      compare_angles(drive, &in->vector);
      if (v->suspicion >= v->lost_checks) {
        drive_lost_lock(drive);
      } else if (drive->state == STATE_RUNNING && drive->state_ticks >= (uint32_t)p->restart_clear_ticks) {
        drive_renew_attempts(drive);
      }
      break;
    default:
      break;
  }
}

HOT complex_t vector_want(drive_t *drive, complex_t current_i_q17) {
  vector_t *v = &drive->vector;
  const direct_set_t *set = &v->direct[v->direct_used];
  const complex_t wanted = complex_regulator_want(&v->regulator, &set->gains, set->reference_i_q17, current_i_q17);
  return set->regulate ? wanted : set->preset_v_q25;
}

HOT void vector_bound(drive_t *drive, complex_t wanted_v_q25) {
  vector_t *v = &drive->vector;
  const direct_set_t *set = &v->direct[v->direct_used];
  (void)complex_regulator_bound(&v->regulator, &set->gains, wanted_v_q25, set->limit_v_q17);
  if (!set->regulate) {
    v->regulator.carry_v_q25 = (complex_t){0, 0};
  }
}

// What is committed in this step, for the regulator in C.
HOT static void stage_direct(vector_t *v, const chip_vector_command_t *c) {
  const complex_t preset_v_q25 = {c->preset_v_q17[0].re * 256, c->preset_v_q17[0].im * 256};
  v->direct[1u - v->direct_used] = (direct_set_t){v->design[v->used].regulator, c->reference_i_q17[0], preset_v_q25,
                                                  (int32_t)c->limit_v_q17[0], c->regulate[0]};
}

HOT static void command(drive_t *drive) {
  const vector_t *v = &drive->vector;
  chip_vector_command_t *c = &drive->command.vector;
  c->omega_turn_q36 = v->speed_turn_q36;
  c->correct_q32 = v->correct_q32;
  c->write_correct = v->correct_q32 != 0;
  const complex_t reference_i_q17 = to_q17(v->reference_i_q25);
  c->write_reference =
      reference_i_q17.re != c->reference_i_q17[0].re || reference_i_q17.im != c->reference_i_q17[0].im;
  c->reference_i_q17[0] = reference_i_q17;
  const bool regulate = v->frame != FRAME_OFF && !v->holding;
  c->write_control = regulate != c->regulate[0] || v->frame == FRAME_OFF || drive->state == STATE_STARTING;
  c->regulate[0] = regulate;
  if (vector_frame_is_injected(drive)) {
    vector_injection_command(drive);
  }
}

COLD static void idle_step(drive_t *drive, const chip_snapshot_t *in) {
  drive->m.speed_rpm_q8 = 0;
  drive->m.motor_q17 = 0;
  if (drive->state == STATE_INIT) {
    drive_init_step(drive, in);
    if (drive->state == STATE_READY && in->vector.steps == 0u) {
      drive_enter_fault(drive, FAULT_NO_SAMPLES);
    }
  } else if (drive->state == STATE_STARTING) {
    start_step(drive, in);
  }
}

INLINED void vector_drive_step(drive_t *drive, const chip_snapshot_t *in) {
  vector_t *v = &drive->vector;
  const bool direct = drive->p->vector_direct != 0;
  if (direct && in->vector.taken) {
    v->direct_used = 1u - v->direct_used;
  }
  drive->command.vector.write_gains = false;
  drive->command.vector.write_limits = false;
  drive->command.vector.write_forward = false;
  drive->command.vector.write_injection = false;
  if (v->finished && !v->design_waits) {
    vector_take_design(drive);
  }
  if (drive->command.vector.read_slow) {
    measure(drive, in);
    if (drive->tick % PROTECT_TICKS == GROUP_SUPERVISION) {
      (void)protect_step(drive, in, (int32_t)rough_length(in->vector.i_q17[0]), PROTECT_TICKS);
    }
  }
  v->current_i_q17 = in->vector.i_q17[0];
  if (has_encoder(drive)) {
    v->frame_turn_q32 = in->vector.theta_sample_q32;
    read_encoder(drive, &in->vector);
  }
  if (drive->request != REQUEST_NONE) {
    drive_handle_request(drive);
  }
  // Nothing else of what it looks at moves here.
  const bool look = in->trip_latched != 0u || drive->m.silent_ticks > 0u;
  if (!look || !drive_supervise(drive, in)) {
    if (v->frame == FRAME_OFF || drive->tick % VECTOR_GROUPS == GROUP_LIMITS) {
      apply_limits(drive);
    }
    if (v->frame == FRAME_OFF) {
      idle_step(drive, in);
    } else if (v->frame == FRAME_CAUGHT) {
      vector_caught_step(drive, in);
    } else if (vector_frame_is_injected(drive)) {
      vector_injection_step(drive, in);
    } else {
      observe(drive, &in->vector);
      if (v->frame == FRAME_FORCED) {
        vector_forced_step(drive, in);
      } else {
        observed_step(drive, in);
      }
    }
  }
  const uint32_t next = (drive->tick + 1u) % VECTOR_GROUPS;
  drive->command.vector.read_slow = v->frame == FRAME_OFF || next == GROUP_SUPERVISION;
  if (drive->command.vector.read_slow) {
    drive->command.vector.read_currents =
        vector_injects(drive) || (drive->tick + 1u) % PROTECT_TICKS == GROUP_SUPERVISION;
  }
  drive->command.vector.read_steps =
      drive->p->vector_tick_samples > 1 || drive->command.vector.read_slow || next == GROUP_SPEED;
  if (drive->command.write_modes) {
    drive->command.vector.tick_by_samples = drive->state != STATE_INIT && drive->state != STATE_FAULT;
  }
  command(drive);
  if (direct) {
    stage_direct(v, &drive->command.vector);
  }
}
