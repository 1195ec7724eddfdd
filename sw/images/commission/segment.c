// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "images/commission/segment.h"

#include "control/fixed.h"

static int32_t stepped(int32_t value, int32_t target, int32_t step) {
  return value + clamp_i32(target - value, -step, step);
}

static complex_t signed_sum(complex_t sum, complex_t value, bool negative) {
  return negative ? complex_sub(sum, value) : complex_add(sum, value);
}

void segment_init(segment_t *segment, const parameters_t *parameters) {
  const uint32_t sample = (uint32_t)parameters->vector_sample_cycles;
  const uint32_t delay = (uint32_t)(((uint64_t)sample * (uint32_t)parameters->vector_delay_q30) >> 30);
  *segment = (segment_t){.lead_cycles = delay + sample / 2u};
  // Everything is read and written at every tick: nothing else needs the time.
  segment->command.look.slow = true;
  segment->command.look.steps = true;
}

void segment_run(segment_t *segment, uint32_t ticks, uint32_t block) {
  segment->sum = (block_t){0};
  segment->lost = false;
  segment->block_ticks = block;
  segment->left_ticks = ticks;
}

static void finish_block(segment_t *segment, const chip_snapshot_t *in) {
  segment->sum.last_i_q17 = in->vector.i_q17[0];
  segment->sum.last_turn_q32 = (int32_t)in->vector.theta_sample_q32;
  segment->sum.omega_turn_q36 = segment->omega_turn_q44 >> 8;
  if (segment->head - segment->tail < BLOCKS) {
    segment->block[segment->head % BLOCKS] = segment->sum;
    segment->head++;
  } else {
    segment->lost = true;
  }
  segment->sum = (block_t){0};
}

static void measure(segment_t *segment, const chip_snapshot_t *in) {
  block_t *sum = &segment->sum;
  const complex_t i = in->vector.i_q17[0];
  const uint32_t place = segment->tick % 4u;
  sum->ticks++;
  sum->i_q17 = complex_add(sum->i_q17, i);
  if (place % 2u == 0u) {
    sum->corner_i_q17 = signed_sum(sum->corner_i_q17, i, place == 2u);
  } else {
    sum->middle_i_q17 = signed_sum(sum->middle_i_q17, i, place == 3u);
  }
  sum->v_q17 = complex_add(sum->v_q17, in->vector.v_sum_q17[0]);
  sum->steps += in->vector.steps;
  if (in->sum_count > 0u) {
    sum->vdc_q21 += in->vdc_sum_q17 * 16 / (int32_t)in->sum_count;
  }
  if (sum->ticks == segment->block_ticks) {
    finish_block(segment, in);
  }
}

static void drive_current(segment_t *segment) {
  const segment_settings_t *set = &segment->set;
  vector_command_t *c = &segment->command;
  const int32_t omega_turn_q36 = segment->omega_turn_q44 >> 8;
  c->control.regulate[0] = true;
  c->reference.i_q17[0] = set->reference_i_q17;
  c->gains.gain[0] = (complex_t){set->gain.re, (int32_t)(((int64_t)omega_turn_q36 * set->cross_q30) >> 30)};
  c->gains.hold[0] = (complex_t){set->gain.im, 0};
  c->gains.shift[0] = set->shift;
  c->fresh |= FRESH_GAINS;
}

static void drive_voltage(segment_t *segment) {
  const segment_settings_t *set = &segment->set;
  vector_command_t *c = &segment->command;
  c->control.regulate[0] = false;
  c->control.preset_v_q17[0] = signed_sum(set->voltage_v_q17, set->alternate_v_q17, segment->tick % 4u >= 2u);
}

void segment_step(segment_t *segment, const chip_snapshot_t *in) {
  const segment_settings_t *set = &segment->set;
  vector_command_t *c = &segment->command;
  segment->tick++;
  segment->trip |= in->trip_latched;
  if (segment->left_ticks > 0u) {
    measure(segment, in);
    segment->left_ticks--;
    segment->silent_ticks = 0;
  }
  segment->forsaken |= set->patience_ticks != 0u && segment->silent_ticks > set->patience_ticks;
  const bool on = set->mode != SEGMENT_OFF && segment->trip == 0u && !segment->forsaken;
  segment->silent_ticks = on ? segment->silent_ticks + 1u : 0u;
  segment->guard.fresh = segment->guard.fresh || segment->guard.enable != on;
  segment->guard.enable = on;
  c->control.enable = on;
  segment->omega_turn_q44 = on ? stepped(segment->omega_turn_q44, set->target_turn_q44, set->step_turn_q44) : 0;
  c->omega_turn_q36 = segment->omega_turn_q44 >> 8;
  c->limits.lead_q32 = (int32_t)(((int64_t)c->omega_turn_q36 * segment->lead_cycles) >> 4);
  c->correct_q32 = segment->turn_q32;
  c->fresh |= FRESH_CONTROL | FRESH_REFERENCE | FRESH_LIMITS;
  segment->turn_q32 = 0;
  c->limits.scale = set->scale;
  c->limits.scale_shift = set->scale_shift;
  c->limits.v_q17[0] = set->limit_v_q17;
  if (on && set->mode == SEGMENT_CURRENT) {
    drive_current(segment);
  } else {
    drive_voltage(segment);
  }
}
