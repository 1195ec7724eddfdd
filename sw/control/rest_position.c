// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/rest_position.h"

#include "control/if_start.h"
#include "control/placement.h"
#include "control/trig.h"

#define EIGHTH_TURN ((int32_t)1 << 29)
#define HALF_TURN INT32_MIN

SMALL_CODE_BEGIN

void rest_position_begin(rest_position_t *state) { *state = (rest_position_t){.phase = REST_FIRST}; }

static void enter(rest_position_t *state, rest_phase_t phase) {
  state->phase = phase;
  state->results = 0;
  state->sum_i_q21 = 0;
}

// Counts a result; true with the mean once `count` of them have come after `settle` left out.
static bool averaged(rest_position_t *state, uint32_t settle, uint32_t count, int32_t value_i_q21, int32_t *mean_i_q21) {
  state->results++;
  if (state->results <= settle) {
    return false;
  }
  state->sum_i_q21 += value_i_q21;
  if (state->results < settle + count) {
    return false;
  }
  const uint64_t size = (uint64_t)((state->sum_i_q21 < 0) ? -state->sum_i_q21 : state->sum_i_q21);
  const int32_t mean = (int32_t)div_sat_u32(size, count);
  *mean_i_q21 = (state->sum_i_q21 < 0) ? -mean : mean;
  return true;
}

// The angle from both frames; the turn from the second one.
static int32_t take_angle(rest_position_t *state, const rest_position_settings_t *settings, int32_t second_i_q21) {
  const complex_t twice = {-second_i_q21, state->first_i_q21};
  if (complex_abs(twice) < (uint32_t)settings->minimum_i_q21) {
    enter(state, REST_NO_SIGNAL);
    return 0;
  }
  enter(state, REST_LOCK);
  return (int32_t)complex_angle_turn_q32(twice) / 2 - EIGHTH_TURN;
}

// i_d is back at 0: which way does the magnet lie?
static int32_t take_polarity(rest_position_t *state, const rest_position_settings_t *settings) {
  const int64_t difference = (int64_t)state->plus_i_q21 - state->minus_i_q21;
  const int64_t least = (((int64_t)state->plus_i_q21 + state->minus_i_q21) * settings->sure_q16) >> 16;
  const bool sure = difference >= least || -difference >= least;
  enter(state, sure ? REST_FOUND : REST_NOT_SURE);
  return (sure && difference < 0) ? HALF_TURN : 0;
}

rest_position_command_t rest_position_step(rest_position_t *state, const rest_position_settings_t *settings, bool fresh,
                                           complex_t vector_i_q21) {
  const int32_t goal_i_q25 = (state->phase == REST_PLUS)    ? settings->current_i_q25
                             : (state->phase == REST_MINUS) ? -settings->current_i_q25
                                                            : 0;
  state->current_i_q25 = fade(state->current_i_q25, goal_i_q25, settings->rise_i_q25);
  const bool there = state->current_i_q25 == goal_i_q25;
  int32_t turn_q32 = 0;
  if (fresh && there) {
    int32_t mean_i_q21 = 0;
    switch (state->phase) {
      case REST_FIRST:
        if (averaged(state, settings->settle, settings->frame_count, vector_i_q21.im, &state->first_i_q21)) {
          turn_q32 = EIGHTH_TURN;
          enter(state, REST_SECOND);
        }
        break;
      case REST_SECOND:
        if (averaged(state, settings->settle, settings->frame_count, vector_i_q21.im, &mean_i_q21)) {
          turn_q32 = take_angle(state, settings, mean_i_q21);
        }
        break;
      case REST_LOCK:
        if (averaged(state, settings->lock - 1u, 1, 0, &mean_i_q21)) {
          enter(state, REST_PLUS);
        }
        break;
      case REST_PLUS:
        if (averaged(state, settings->current_settle, settings->current_count, vector_i_q21.re, &state->plus_i_q21)) {
          enter(state, REST_MINUS);
        }
        break;
      case REST_MINUS:
        if (averaged(state, settings->current_settle, settings->current_count, vector_i_q21.re, &state->minus_i_q21)) {
          enter(state, REST_RELEASE);
        }
        break;
      case REST_RELEASE:
        if (averaged(state, settings->current_settle, 1, 0, &mean_i_q21)) {
          turn_q32 = take_polarity(state, settings);
        }
        break;
      case REST_FOUND:
      case REST_NOT_SURE:
      case REST_NO_SIGNAL:
      default:
        break;
    }
  }
  return (rest_position_command_t){turn_q32, state->current_i_q25, state->phase >= REST_LOCK && state->phase != REST_NO_SIGNAL};
}

SMALL_CODE_END
