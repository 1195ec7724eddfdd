// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/open_phase.h"

#include <stdbool.h>

#include "control/fixed.h"
#include "control/placement.h"

#define SAMPLES_LEAST 3u
#define MEAN_SHARE 8
#define SUM_SHARE 4
#define SIZE_SHARE 2
#define WAVE_SHARE 4

SMALL_CODE_BEGIN

void open_phase_begin(open_phase_t *state) { *state = (open_phase_t){.open = 0}; }

HOT uint32_t open_phase_step(open_phase_t *state, const open_phase_settings_t *settings, const int32_t *i_q17,
                             uint32_t phases, uint32_t amplitude_i_q17, uint32_t angle_q32) {
  const int32_t turned_q32 = (int32_t)(angle_q32 - state->angle_q32);
  const uint32_t least_q17 = (uint32_t)(((uint64_t)amplitude_i_q17 * settings->share_q16) >> 16);
  const bool judged = amplitude_i_q17 >= settings->minimum_i_q17;
  state->angle_q32 = angle_q32;
  int32_t sum_i_q17 = 0;
  for (uint32_t k = 0; k < phases; k++) {
    sum_i_q17 += i_q17[k];
  }
  const bool whole = (uint32_t)abs_sat(sum_i_q17) < least_q17;
  for (uint32_t k = 0; k < phases; k++) {
    if (!judged || !whole || (uint32_t)abs_sat(i_q17[k]) >= least_q17) {
      state->quiet_q32[k] = 0;
      state->samples[k] = 0;
      continue;
    }
    // An open phase is quiet for ever: held at what is enough.
    const int32_t enough_q32 = (int32_t)settings->turn_q32 + 1;
    state->quiet_q32[k] += (state->samples[k] > 0u) ? turned_q32 : 0;
    state->quiet_q32[k] = clamp_i32(state->quiet_q32[k], -enough_q32, enough_q32);
    state->samples[k]++;
    if (state->samples[k] >= SAMPLES_LEAST && abs_sat(state->quiet_q32[k]) == enough_q32) {
      state->open |= 1u << k;
    }
  }
  return state->open;
}

// A first wave that carries a quarter of the second is not heard: along the axis of an open first phase it shows noise. One
// wave alone tells nothing of the other phases.
COLD static void take_wave(open_phase_t *state, uint32_t phases) {
  int32_t mean_i_q17 = 0;
  int32_t sum_i_q17 = 0;
  for (uint32_t k = 0; k < phases; k++) {
    sum_i_q17 += state->along_i_q17[k];
    state->along_i_q17[k] = abs_sat(state->along_i_q17[k]);
    mean_i_q17 += state->along_i_q17[k] / (int32_t)phases;
  }
  if (mean_i_q17 == 0) {
    return;
  }
  const bool alone = state->mean_i_q17 < mean_i_q17 / WAVE_SHARE;
  state->told = alone ? 1u : phases;
  state->mean_i_q17 = (alone ? 0 : state->mean_i_q17) + mean_i_q17;
  state->sum_i_q17 = (alone ? 0 : state->sum_i_q17) + abs_sat(sum_i_q17);
  for (uint32_t k = 0; k < phases; k++) {
    state->whole_i_q17[k] = (alone ? 0 : state->whole_i_q17[k]) + state->along_i_q17[k];
    state->along_i_q17[k] = 0;
  }
}

COLD void open_phase_note(open_phase_t *state, const int32_t *i_q17, uint32_t phases, uint32_t wave) {
  if (wave != state->wave) {
    take_wave(state, phases);
    state->wave = wave;
  }
  const bool against = i_q17[0] < i_q17[phases - 1u];
  for (uint32_t k = 0; k < phases; k++) {
    state->along_i_q17[k] += against ? -i_q17[k] : i_q17[k];
    state->size_i_q17[k] += abs_sat(i_q17[k]);
    state->sizes_i_q17 += abs_sat(i_q17[k]) / (int32_t)phases;
  }
}

COLD uint32_t open_phase_judge(open_phase_t *state, uint32_t phases) {
  take_wave(state, phases);
  if (state->sum_i_q17 >= state->mean_i_q17 / SUM_SHARE) {
    return state->open;
  }
  for (uint32_t k = 0; k < state->told; k++) {
    const bool quiet = state->size_i_q17[k] < state->sizes_i_q17 / SIZE_SHARE;
    state->open |= (quiet && state->whole_i_q17[k] < state->mean_i_q17 / MEAN_SHARE) ? 1u << k : 0u;
  }
  return state->open;
}

SMALL_CODE_END
