// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/open_phase.h"

#include <stdbool.h>

#include "control/fixed.h"
#include "control/placement.h"

#define SAMPLES_LEAST 3u

SMALL_CODE_BEGIN

void open_phase_begin(open_phase_t *state) { *state = (open_phase_t){.open = 0}; }

HOT uint32_t open_phase_step(open_phase_t *state, const open_phase_settings_t *settings, const int32_t *i_q17,
                             uint32_t phases, uint32_t amplitude_i_q17, uint32_t angle_q32) {
  const int32_t turned_q32 = (int32_t)(angle_q32 - state->angle_q32);
  const uint32_t least_q17 = (uint32_t)(((uint64_t)amplitude_i_q17 * settings->share_q16) >> 16);
  const bool judged = amplitude_i_q17 >= settings->minimum_i_q17;
  state->angle_q32 = angle_q32;
  for (uint32_t k = 0; k < phases; k++) {
    if (!judged || (uint32_t)abs_sat(i_q17[k]) >= least_q17) {
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

SMALL_CODE_END
