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

void if_begin(if_start_t *state) { *state = (if_start_t){.share_q16 = IF_WHOLE_Q16}; }

void if_resume(if_start_t *state, const if_settings_t *settings, int32_t speed_turn_q36, uint32_t amplitude_i_q25,
               int32_t due_v_q25) {
  *state = (if_start_t){
      .speed_turn_q44 = (int64_t)speed_turn_q36 * (1 << SPEED_BITS),
      .current_i_q25 = (int32_t)amplitude_i_q25,
      .emf_v_q25 = {0, due_v_q25},
      .aligned_ticks = settings->align_ticks,
      .share_q16 = IF_WHOLE_Q16,
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
  const int64_t step = mul_q16(settings->acceleration_turn_q44, state->share_q16);
  const bool there = gap <= step && gap >= -step;
  if (there) {
    state->speed_turn_q44 = target;
  } else {
    state->speed_turn_q44 += (gap > 0) ? step : -step;
  }
  return there && whole;
}

HOT complex_t if_current_i_q25(if_start_t *state, const if_settings_t *settings, complex_t emf_v_q25, int32_t due_v_q25) {
  state->emf_v_q25.re += mul_q16(emf_v_q25.re - state->emf_v_q25.re, settings->smooth_q16);
  state->emf_v_q25.im += mul_q16(emf_v_q25.im - state->emf_v_q25.im, settings->smooth_q16);
  const int32_t most_i_q25 = state->current_i_q25 / 5 * 2;
  const bool turned = state->aligned_ticks < settings->turned_ticks;
  const int32_t across_v_q25 = turned ? state->emf_v_q25.re : state->emf_v_q25.im;
  const int32_t across_i_q25 = clamp_i32(gain_apply(due_v_q25 - across_v_q25, settings->damping), -most_i_q25, most_i_q25);
  state->damping_i_q25 = across_i_q25;
  return turned ? (complex_t){across_i_q25, -state->current_i_q25} : (complex_t){state->current_i_q25, across_i_q25};
}

HOT int32_t if_share_q16(int32_t emf_v_q25, uint32_t due_v_q25) {
  const int32_t over_v_q25 = emf_v_q25 - (int32_t)(due_v_q25 / 2u);
  if (over_v_q25 <= 0) {
    return 0;
  }
  return clamp_i32((int32_t)div_sat_u32((uint64_t)(uint32_t)over_v_q25 << 16, due_v_q25 / 20u * 7u), 0, IF_WHOLE_Q16);
}

int32_t if_speed_turn_q36(const if_start_t *state) { return (int32_t)(state->speed_turn_q44 >> SPEED_BITS); }

HOT bool if_ready(if_start_t *state, const if_settings_t *settings) {
  const int32_t quarter = (state->speed_turn_q44 < 0) ? -QUARTER_TURN : QUARTER_TURN;
  state->turn_q32 = (int32_t)(complex_angle_turn_q32(state->emf_v_q25) - (uint32_t)quarter);
  const int32_t change = (int32_t)((uint32_t)state->turn_q32 - (uint32_t)state->turn_from_q32);
  const bool seen = complex_abs(state->emf_v_q25) >= settings->minimum_v_q25 && abs_sat(state->turn_q32) < QUARTER_TURN;
  const bool steady = seen && abs_sat(change) <= settings->tolerance_turn_q32;
  state->steady_ticks = steady ? state->steady_ticks + 1u : 0u;
  if (!steady) {
    state->turn_from_q32 = state->turn_q32;
  } else if (state->steady_ticks == settings->steady_ticks / 2u) {
    state->turn_middle_q32 = state->turn_q32;
  }
  return state->steady_ticks >= settings->steady_ticks;
}

HOT int32_t if_turn_back_q32(complex_t current_i_q25) { return (int32_t)complex_angle_turn_q32(current_i_q25); }
