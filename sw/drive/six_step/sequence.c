// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "drive/six_step/sequence.h"

#include "control/placement.h"

#define INTERVAL_MAX 0xFFFFFFu

SMALL_CODE_BEGIN

COLD void sequence_init(sequence_command_t *c, const settings_t *settings) {
  c->sampling = SAMPLING_CONTINUOUS;
  c->forced_interval_cycles = INTERVAL_MAX;
  c->crossing = settings->crossing;
  c->commutation = settings->commutation;
  c->pattern = settings->pattern;
}

COLD void sequence_off(sequence_command_t *c) {
  c->sequencer = SEQUENCER_OFF;
  c->timer = COMMUTATION_OFF;
  c->zcd_enable = false;
  c->sampling = SAMPLING_CONTINUOUS;
  c->miss_limit = 0;
  c->force_on_miss = false;
  for (uint32_t x = 0; x < PHASES; x++) {
    c->leg[x] = LEG_OFF;
  }
  c->fresh = true;
}

COLD void sequence_legs(sequence_command_t *c, leg_command_t others, uint32_t special, leg_command_t command) {
  c->sequencer = SEQUENCER_MANUAL;
  for (uint32_t x = 0; x < PHASES; x++) {
    c->leg[x] = (x == special) ? command : others;
  }
  c->fresh = true;
}

COLD void sequence_run(sequence_command_t *c, uint32_t start_sector) {
  c->sequencer = SEQUENCER_SIX_STEP;
  c->start_sector = start_sector;
  c->zcd_enable = true;
  c->fresh = true;
}

COLD void sequence_direct(sequence_command_t *c, bool reverse) {
  c->reverse = reverse;
  c->fresh = true;
}

COLD void sequence_time(sequence_command_t *c, commutation_mode_t timer) {
  c->timer = timer;
  c->fresh = true;
}

COLD void sequence_force(sequence_command_t *c, uint32_t interval_cycles) {
  c->forced_interval_cycles = interval_cycles;
  c->fresh = true;
}

COLD void sequence_miss(sequence_command_t *c, uint32_t miss_limit) {
  c->miss_limit = miss_limit;
  c->fresh = true;
}

COLD void sequence_force_on_miss(sequence_command_t *c, bool forced) {
  c->force_on_miss = forced;
  c->fresh = true;
}

COLD void sequence_sample(sequence_command_t *c, uint32_t sampling) {
  c->sampling = sampling;
  c->fresh = true;
}

COLD void sequence_pattern(sequence_command_t *c, const settings_t *settings) {
  c->pattern = settings->pattern;
  c->fresh = true;
}

void sequence_align(sequence_command_t *c, uint32_t commutation) {
  c->fresh = c->fresh || c->commutation != commutation;
  c->commutation = commutation;
}

void sequence_rectify(sequence_command_t *c, bool sync_rect) {
  c->fresh = c->fresh || c->sync_rect != sync_rect;
  c->sync_rect = sync_rect;
}

COLD bool sequence_cross(sequence_command_t *c, const settings_t *settings) {
  const bool other_signal = c->crossing.zcd_source != settings->crossing.zcd_source;
  c->crossing = settings->crossing;
  c->fresh = true;
  return other_signal;
}

COLD void sequence_never_back(sequence_command_t *c) {
  c->crossing.compute_back = false;
  c->fresh = true;
}

void sequence_refresh(sequence_command_t *c) { c->fresh = true; }

SMALL_CODE_END
