// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/if_start.h"

#include "control/placement.h"
#include "control/trig.h"

#define SPEED_BITS 8
#define QUARTER_TURN ((int32_t)1 << 30)

HOT int32_t fade(int32_t from, int32_t to, int32_t step) {
  if (to == from) {
    return to;
  }
  if (to > from) {
    return ((int64_t)to - from > step) ? from + step : to;
  }
  return ((int64_t)from - to > step) ? from - step : to;
}

void if_begin(if_start_t *state) { *state = (if_start_t){0}; }

void if_resume(if_start_t *state, const if_settings_t *settings, int32_t speed_turn_q36, uint32_t amplitude_i_q25) {
  *state = (if_start_t){
      .speed_turn_q44 = (int64_t)speed_turn_q36 * (1 << SPEED_BITS),
      .current_i_q25 = (int32_t)amplitude_i_q25,
      .aligned_ticks = settings->align_ticks,
  };
}

HOT bool if_step(if_start_t *state, const if_settings_t *settings, int32_t target_turn_q36) {
  state->current_i_q25 = fade(state->current_i_q25, settings->current_i_q25, settings->rise_i_q25);
  const bool whole = state->current_i_q25 == settings->current_i_q25;
  if (state->aligned_ticks < settings->align_ticks) {
    state->aligned_ticks += whole ? 1u : 0u;
    return false;
  }
  const int64_t target = (int64_t)target_turn_q36 * (1 << SPEED_BITS);
  const int64_t gap = target - state->speed_turn_q44;
  const int64_t step = settings->acceleration_turn_q44;
  const bool there = gap <= step && gap >= -step;
  if (there) {
    state->speed_turn_q44 = target;
  } else {
    state->speed_turn_q44 += (gap > 0) ? step : -step;
  }
  return there && whole;
}

int32_t if_speed_turn_q36(const if_start_t *state) { return (int32_t)(state->speed_turn_q44 >> SPEED_BITS); }

HOT bool if_ready(if_start_t *state, const if_settings_t *settings, complex_t emf_v_q25) {
  const int32_t quarter = (state->speed_turn_q44 < 0) ? -QUARTER_TURN : QUARTER_TURN;
  const int32_t last = state->turn_q32;
  state->turn_q32 = (int32_t)(complex_angle_turn_q32(emf_v_q25) - (uint32_t)quarter);
  const int32_t change = (int32_t)((uint32_t)state->turn_q32 - (uint32_t)last);
  const bool steady = complex_abs(emf_v_q25) >= settings->minimum_v_q25 &&
                      abs_sat(change) <= settings->tolerance_turn_q32 && abs_sat(state->turn_q32) < QUARTER_TURN;
  state->steady_ticks = steady ? state->steady_ticks + 1u : 0u;
  return state->steady_ticks >= settings->steady_ticks;
}

HOT int32_t if_turn_back_q32(complex_t current_i_q25) { return (int32_t)complex_angle_turn_q32(current_i_q25); }
