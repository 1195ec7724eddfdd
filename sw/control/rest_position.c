// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/rest_position.h"

#include "control/if_start.h"
#include "control/placement.h"
#include "control/trig.h"

#define EIGHTH_TURN ((int32_t)1 << 29)
#define HALF_TURN INT32_MIN
#define MOVED_Q32 178956971  // 1/24 turn
#define LOCK_SHARE 4
#define LAST_SHARE 4u
#define CAME_SHARE 3
#define SPARE 2  // of the difference that is sure, for a second look

SMALL_CODE_BEGIN

void rest_position_begin(rest_position_t *state) { *state = (rest_position_t){.phase = REST_FIRST}; }

static void enter(rest_position_t *state, rest_phase_t phase) {
  state->phase = phase;
  state->results = 0;
  state->sum_i_q21[0] = state->sum_i_q21[1] = state->sum_i_q25 = 0;
}

static int32_t mean_of(int64_t sum, uint32_t count) {
  const int32_t mean = (int32_t)div_sat_u32((uint64_t)((sum < 0) ? -sum : sum), count);
  return (sum < 0) ? -mean : mean;
}

// Counts a result; true with the mean once `count` of them have come after `settle` left out.
static bool averaged(rest_position_t *state, uint32_t settle, uint32_t count, const rest_position_input_t *in,
                     complex_t *mean_i_q21) {
  state->results++;
  if (state->results <= settle) {
    return false;
  }
  state->sum_i_q21[0] += in->vector_i_q21.re;
  state->sum_i_q21[1] += in->vector_i_q21.im;
  state->sum_i_q25 += in->d_i_q25;
  if (state->results < settle + count) {
    return false;
  }
  *mean_i_q21 = (complex_t){mean_of(state->sum_i_q21[0], count), mean_of(state->sum_i_q21[1], count)};
  return true;
}

// Once more from a phase on, or the end.
static void fail(rest_position_t *state, rest_phase_t next, rest_phase_t end) {
  state->tries++;
  enter(state, (state->tries < SEARCH_TRIES) ? next : end);
}

// The rotor turned, or the current did not come: half of it does less.
static void soften(rest_position_t *state) {
  if (state->again) {
    enter(state, REST_FOUND);
    return;
  }
  state->halvings++;
  fail(state, REST_LOCK, REST_NOT_SURE);
}

// The angle from both frames; the turn from the second one.
static int32_t take_angle(rest_position_t *state, const rest_position_settings_t *settings, int32_t second_i_q21) {
  const complex_t twice = {-second_i_q21, state->first_i_q21};
  state->saliency_i_q21 = (int32_t)complex_abs(twice);
  if (state->saliency_i_q21 < settings->minimum_i_q21) {
    enter(state, REST_NO_SIGNAL);
    return 0;
  }
  enter(state, REST_LOCK);
  return (int32_t)complex_angle_turn_q32(twice) / 2 - EIGHTH_TURN;
}

// Is it an angle that the loop holds?
static void take_lock(rest_position_t *state, complex_t mean_i_q21, int32_t drift_q32) {
  state->d_i_q21 = mean_i_q21.re;
  state->moved_q32 = 0;
  state->drift_q32 = drift_q32;
  if (abs_sat(mean_i_q21.im) > state->saliency_i_q21 / LOCK_SHARE) {
    fail(state, REST_FIRST, REST_NO_SIGNAL);
  } else {
    enter(state, REST_PLUS);
  }
}

// Of A+ - A-, which are below 2^24.
static int32_t least_i_q21(const rest_position_t *state, const rest_position_settings_t *settings) {
  return mul_q16(state->plus_i_q21 + state->minus_i_q21, settings->sure_q16);
}

// Which way does the magnet lie: along the frame's d axis 1, against it -1, 0 not sure.
static int32_t pole(const rest_position_t *state, const rest_position_settings_t *settings) {
  const int32_t difference = state->plus_i_q21 - state->minus_i_q21;
  const int32_t least = least_i_q21(state, settings);
  return (difference >= least) ? 1 : (-difference >= least) ? -1 : 0;
}

COLD void rest_position_again(rest_position_t *state, const rest_position_settings_t *settings, bool on) {
  if (!state->again) {
    const int32_t least = least_i_q21(state, settings);
    int32_t left = abs_sat(state->plus_i_q21 - state->minus_i_q21);
    while (least > 0 && left >= 2 * SPARE * least) {
      left /= 2;
      state->halvings++;
    }
  }
  state->again = true;
  state->moved_q32 = state->drift_q32 = 0;
  if (!on) {
    state->phase = REST_FOUND;
  } else if (state->phase == REST_FOUND) {
    enter(state, REST_PLUS);
    state->plus_i_q21 = state->minus_i_q21 = state->pole = 0;
  }
}

// The amplitude at +I or -I, if that current has come; the pole of a frame that is held.
static void take_amplitude(rest_position_t *state, const rest_position_settings_t *settings, complex_t mean_i_q21) {
  const int32_t came_i_q25 = mean_of(state->sum_i_q25, settings->current_count);
  if (abs_sat(came_i_q25 - state->current_i_q25) > abs_sat(state->current_i_q25) / CAME_SHARE) {
    soften(state);
    return;
  }
  const bool plus = state->phase == REST_PLUS;
  *(plus ? &state->plus_i_q21 : &state->minus_i_q21) = mean_i_q21.re;
  enter(state, plus ? REST_MINUS : state->again ? REST_PLUS : REST_RELEASE);
  if (state->again && state->plus_i_q21 != 0 && state->minus_i_q21 != 0) {
    state->pole = pole(state, settings);
  }
}

// i_d is back at 0.
static int32_t take_polarity(rest_position_t *state, const rest_position_settings_t *settings) {
  const int32_t found = pole(state, settings);
  enter(state, (found != 0) ? REST_FOUND : REST_NOT_SURE);
  return (found < 0) ? HALF_TURN : 0;
}

static int32_t goal_i_q25(const rest_position_t *state, const rest_position_settings_t *settings) {
  const int32_t current_i_q25 = settings->current_i_q25 >> state->halvings;
  return (state->phase == REST_PLUS) ? current_i_q25 : (state->phase == REST_MINUS) ? -current_i_q25 : 0;
}

// A phase whose current is there has a new result; by how much the frame goes on.
static int32_t result(rest_position_t *state, const rest_position_settings_t *settings, const rest_position_input_t *in) {
  complex_t mean_i_q21 = {0, 0};
  const uint32_t last = settings->lock / LAST_SHARE + 1u;
  switch (state->phase) {
    case REST_FIRST:
      if (averaged(state, settings->settle, settings->frame_count, in, &mean_i_q21)) {
        state->first_i_q21 = mean_i_q21.im;
        enter(state, REST_SECOND);
        return EIGHTH_TURN;
      }
      break;
    case REST_SECOND:
      if (averaged(state, settings->settle, settings->frame_count, in, &mean_i_q21)) {
        return take_angle(state, settings, mean_i_q21.im);
      }
      break;
    case REST_LOCK:
      if (averaged(state, settings->lock - last, last, in, &mean_i_q21)) {
        take_lock(state, mean_i_q21, in->drift_q32);
      }
      break;
    case REST_PLUS:
    case REST_MINUS:
      if (averaged(state, settings->current_settle, settings->current_count, in, &mean_i_q21)) {
        take_amplitude(state, settings, mean_i_q21);
      }
      break;
    case REST_RELEASE:
      if (averaged(state, settings->current_settle, 1, in, &mean_i_q21)) {
        return take_polarity(state, settings);
      }
      break;
    case REST_FOUND:
    case REST_NOT_SURE:
    case REST_NO_SIGNAL:
    default:
      break;
  }
  return 0;
}

rest_position_command_t rest_position_step(rest_position_t *state, const rest_position_settings_t *settings,
                                           const rest_position_input_t *in) {
  state->moved_q32 = sat_i32((int64_t)state->moved_q32 + in->turned_q32 - state->drift_q32);
  const bool currents = state->phase >= REST_PLUS && state->phase <= REST_RELEASE;
  if (currents && abs_sat(state->moved_q32) > MOVED_Q32) {
    soften(state);
  }
  const int32_t goal = goal_i_q25(state, settings);
  state->current_i_q25 = fade(state->current_i_q25, goal, settings->rise_i_q25);
  const int32_t turn_q32 = (in->fresh && state->current_i_q25 == goal) ? result(state, settings, in) : 0;
  return (rest_position_command_t){turn_q32, state->current_i_q25, state->phase >= REST_LOCK && state->phase != REST_NO_SIGNAL};
}

SMALL_CODE_END
