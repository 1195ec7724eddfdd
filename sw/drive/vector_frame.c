// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/fixed.h"
#include "control/placement.h"
#include "control/trig.h"
#include "control/vector_speed.h"
#include "drive/start.h"
#include "drive/vector_injection.h"
#include "drive/vector_parts.h"

#define QUARTER_TURN ((uint32_t)1 << 30)
#define CHANGE_MAX_Q32 (1 << 22)

COLD void vector_off(drive_t *drive) {
  vector_t *v = &drive->vector;
  chip_vector_command_t *command = &drive->command.vector;
  v->frame = FRAME_OFF;
  v->speed_turn_q36 = 0;
  v->correct_q32 = 0;
  v->holding = false;
  v->reference_i_q25 = (complex_t){0, 0};
  v->state_v_q25 = (complex_t){0, 0};
  v->late_v_q25 = (complex_t){0, 0};
  v->suspicion = 0;
  command->enable = false;
  command->regulate[0] = false;
  command->preset_v_q17[0] = (complex_t){0, 0};
  if (vector_injects(drive)) {
    vector_injection_off(drive);
  }
}

COLD static void enter_phase(drive_t *drive, phase_t phase) {
  drive->phase = phase;
  drive->state_ticks = 0;
}

COLD void vector_begin(drive_t *drive) {
  vector_t *v = &drive->vector;
  if (vector_injects(drive)) {
    vector_injection_begin(drive);
    return;
  }
  const complex_t zero = {0, 0};
  if_begin(&v->start);
  emf_observer_preset(&v->observer, zero, zero, zero);
  v->weakening.current_i_q30 = 0;
  v->mtpa_i_q25 = 0;
  v->waiting_ticks = 0;
  v->frame = FRAME_FORCED;
  drive->brake_i_q25 = 0;
  drive->command.gate_enable = true;
  drive->command.vector.enable = true;
  drive->command.vector.regulate[0] = true;
  enter_phase(drive, START_ALIGN);
}

COLD bool vector_catch(drive_t *drive, uint32_t angle_q32, int32_t mean_step_q32) {
  const parameters_t *p = drive->p;
  vector_t *v = &drive->vector;
  const int32_t speed_turn_q36 = (mean_step_q32 / (int32_t)v->per_tick.period_cycles) * 16;
  if (v->sensored || abs_sat(speed_turn_q36) < p->vector_handover_turn_q36) {
    return false;
  }
  // The EMF stands a quarter ahead of the magnet in the direction of rotation. What is set now acts at the next tick.
  const uint32_t quarter = (speed_turn_q36 < 0) ? 0u - QUARTER_TURN : QUARTER_TURN;
  v->correct_q32 = (int32_t)(angle_q32 + (uint32_t)mean_step_q32 - quarter - v->angle_turn_q32);
  v->holding = true;
  v->speed_turn_q36 = speed_turn_q36;
  v->direction = (speed_turn_q36 < 0) ? -1 : 1;
  const complex_t emf_v_q25 = {0, gain_apply(speed_turn_q36, p->vector_flux)};
  drive->command.vector.preset_v_q17[0] = to_q17(emf_v_q25);
  v->reference_i_q25 = (complex_t){0, 0};
  v->goal_i_q25 = 0;
  v->weakening.current_i_q30 = 0;
  v->mtpa_i_q25 = 0;
  v->waiting_ticks = 0;
  v->suspicion = 0;
  v->frame = FRAME_CAUGHT;
  return true;
}

// The frame goes along; two ticks after it was turned the legs' compares are those of the EMF.
COLD void vector_caught_step(drive_t *drive, const chip_snapshot_t *in) {
  vector_t *v = &drive->vector;
  if (in->vector.taken) {
    v->correct_q32 = 0;
    v->waiting_ticks++;
  }
  if (v->waiting_ticks < 2u) {
    return;
  }
  const complex_t zero = {0, 0};
  const complex_t emf_v_q25 = {0, gain_apply(v->speed_turn_q36, drive->p->vector_flux)};
  emf_observer_preset(&v->observer, zero, emf_v_q25, emf_v_q25);
  v->holding = false;
  v->frame = FRAME_OBSERVED;
  pll_preset(&v->pll, 0, v->speed_turn_q36);
  ramp_preset(&drive->ramp, rpm_q8(drive, v->speed_turn_q36));
  drive->brake_i_q25 = drive->settings.brake_limit_i_q25;
  vector_speed_preset(&v->speed, &v->speed_gains, v->speed_turn_q36, v->speed_turn_q36, 0);
  drive->command.gate_enable = true;
  drive->command.vector.enable = true;
  drive->catches++;
  enter_phase(drive, START_HAND_OVER);
}

// The frame goes ahead by `turn`, the regulator is held for a tick at the voltage of now seen from there. What it
// remembers of the error is made anew meanwhile.
COLD static void turn_frame(drive_t *drive, const chip_snapshot_t *in, int32_t turn_q32, complex_t current_i_q25) {
  vector_t *v = &drive->vector;
  const complex_t rotation = rotation_q30(turn_q32);
  v->correct_q32 = turn_q32;
  v->holding = true;
  v->reference_i_q25 = complex_mul_q30(current_i_q25, rotation);
  v->goal_i_q25 = v->reference_i_q25.re;
  v->late_v_q25 = complex_mul_q30(v->late_v_q25, rotation);
  drive->command.vector.preset_v_q17[0] = to_q17(complex_mul_q30(in->vector.u_v_q25[0], rotation));
}

COLD static void hand_over(drive_t *drive, const chip_snapshot_t *in) {
  vector_t *v = &drive->vector;
  turn_frame(drive, in, v->start.turn_q32, v->reference_i_q25);
  v->frame = FRAME_OBSERVED;
  // The rotor swings in the forced frame: its speed is that of the frame and of the swing. From the turns in the two
  // halves of the steady time, h ticks each: (3 second - first) / 2h at its end, (second - first) / h^2 more a tick. By the
  // encoder the frame is handed over at rest, without a steady time.
  const int32_t half = (int32_t)v->start.steady_ticks / 2;
  int32_t change_q32 = 0;
  if (half > 0) {
    const int32_t first_q32 = (int32_t)((uint32_t)v->turn_middle_q32 - (uint32_t)v->turn_from_q32);
    const int32_t second_q32 = (int32_t)((uint32_t)v->start.turn_q32 - (uint32_t)v->turn_middle_q32);
    const int32_t cycles = half * (int32_t)v->per_tick.period_cycles;
    v->speed_turn_q36 += ((second_q32 + (second_q32 - first_q32) / 2) / cycles) * 16;
    change_q32 = (second_q32 - first_q32) / (half * half);
  }
  v->direction = (v->speed_turn_q36 < 0) ? -1 : 1;
  v->suspicion = 0;
  pll_preset(&v->pll, 0, v->speed_turn_q36);
  if (v->pll_gains.acceleration.mant != 0) {
    const int32_t change_q40 = clamp_i32(change_q32, -CHANGE_MAX_Q32, CHANGE_MAX_Q32) * 256;
    v->pll.acceleration_turn_q60 = (int64_t)(change_q40 / (int32_t)v->per_tick.period_cycles) * (1 << 20);
  }
  ramp_preset(&drive->ramp, rpm_q8(drive, v->speed_turn_q36));
  drive->brake_i_q25 = drive->settings.brake_limit_i_q25;
  vector_speed_preset(&v->speed, &v->speed_gains, v->speed_turn_q36, v->speed_turn_q36, v->reference_i_q25.im);
  enter_phase(drive, START_HAND_OVER);
}

// The current lies on d again: of the same length, so that nothing jumps.
COLD void vector_hand_back(drive_t *drive, const chip_snapshot_t *in) {
  vector_t *v = &drive->vector;
  const complex_t current = v->reference_i_q25;
  turn_frame(drive, in, if_turn_back_q32(current), current);
  if_resume(&v->start, &v->start_settings, v->speed_turn_q36, complex_abs(current));
  v->waiting_ticks = 0;
  v->frame = FRAME_FORCED;
  if (drive->state == STATE_RUNNING) {
    drive_enter(drive, STATE_STARTING);
    enter_phase(drive, START_RAMP);
  }
}

// The rotor swings about the standing current.
COLD static void watch_alignment(drive_t *drive) {
  vector_t *v = &drive->vector;
  if (v->start.aligned_ticks <= 1u) {
    encoder_swing_begin(&v->swing, v->encoder_turn_q32);
  }
  encoder_swing_step(&v->swing, v->encoder_turn_q32);
}

COLD static void learn_mounting(drive_t *drive, const chip_vector_snapshot_t *in) {
  vector_t *v = &drive->vector;
  if (!in->encoder_indexed) {
    v->encoder_offset_q32 = v->frame_turn_q32 - encoder_swing_middle_q32(&v->swing);
  }
}

SHARED void vector_forced_step(drive_t *drive, const chip_snapshot_t *in) {
  vector_t *v = &drive->vector;
  const parameters_t *p = drive->p;
  const bool stopping = drive->state == STATE_STOPPING;
  const int32_t target = (drive->settings.target_rpm < 0) ? -p->vector_handover_turn_q36 : p->vector_handover_turn_q36;
  const bool there = if_step(&v->start, &v->start_settings, stopping ? 0 : target);
  v->speed_turn_q36 = if_speed_turn_q36(&v->start);
  v->reference_i_q25 = (complex_t){v->start.current_i_q25, 0};
  drive->m.speed_rpm_q8 = rpm_q8(drive, v->speed_turn_q36);
  drive->ramp.value_rpm_q8 = drive->m.speed_rpm_q8;
  if (drive->phase == START_ALIGN) {
    if (has_encoder(drive)) {
      watch_alignment(drive);
    }
    if (v->start.aligned_ticks >= v->start_settings.align_ticks) {
      enter_phase(drive, START_RAMP);
      if (has_encoder(drive)) {
        learn_mounting(drive, &in->vector);
      }
    }
  }
  if (v->sensored) {
    if (drive->phase == START_RAMP) {
      v->start.turn_q32 = (int32_t)(encoder_angle_q32(v) - v->frame_turn_q32);
      v->start.steady_ticks = 0;
      hand_over(drive, in);
    }
    return;
  }
  if (!there) {
    v->waiting_ticks = 0;
    return;
  }
  if (stopping) {
    drive_gates_off(drive);
    drive_enter(drive, STATE_READY);
    return;
  }
  const bool ready = if_ready(&v->start, &v->start_settings, v->observer.emf_v_q25);
  if (v->start.steady_ticks <= 1u) {
    v->turn_from_q32 = v->start.turn_q32;
  } else if (v->start.steady_ticks == v->start_settings.steady_ticks / 2u + 1u) {
    v->turn_middle_q32 = v->start.turn_q32;
  }
  if (ready) {
    hand_over(drive, in);
    return;
  }
  v->waiting_ticks++;
  if (v->waiting_ticks > (uint32_t)p->lock_timeout_ticks + v->start_settings.steady_ticks) {
    start_failed(drive);
  }
}
