// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/injection_frame.h"

#include "control/placement.h"
#include "control/trig.h"
#include "control/vector_speed.h"

#define FILTER_BITS 16
#define FREE_SHARE 4  // of the limit that i_q keeps beside the current that looks at the poles

SMALL_CODE_BEGIN

static void turn_references(injection_frame_t *state, const injection_frame_settings_t *settings) {
  state->turn_q30 = cis_q30((uint32_t)state->curve_q32);
  if (settings->third) {
    state->third_turn_q30 = cis_q30(3u * (uint32_t)state->curve_q32);
  }
}

void injection_frame_begin(injection_frame_t *state, const injection_frame_settings_t *settings, bool resting,
                           int32_t speed_turn_q36) {
  *state = (injection_frame_t){.resting = resting};
  rest_position_begin(&state->rest);
  if (!resting) {
    rest_position_again(&state->rest, &settings->rest, false);
  }
  injection_handover_begin(&state->handover, false);
  injection_validity_begin(&state->validity);
  pll_preset(&state->pll, 0, speed_turn_q36);
  cross_coupling_begin(&state->coupling, &settings->coupling, 0);
  state->curve_q32 = state->coupling.c_q32;
  turn_references(state, settings);
  state->filtered_q52 = (int64_t)speed_turn_q36 * (1 << FILTER_BITS);
}

// Both angles, modulo a turn.
static int32_t turned(int32_t a_q32, int32_t b_q32) { return (int32_t)((uint32_t)a_q32 + (uint32_t)b_q32); }

// By how much the frame turns after one error.
SHARED static int32_t follow(injection_frame_t *state, const injection_frame_settings_t *settings, int32_t error_q30) {
  return pll_correct(&state->pll, &settings->pll, error_q30);
}

// i_q* within what the validity leaves.
HOT static void regulate(injection_frame_t *state, const injection_frame_settings_t *settings,
                         const injection_frame_input_t *in) {
  const int64_t speed_q52 = (int64_t)pll_speed_turn_q36(&state->pll) * (1 << FILTER_BITS);
  state->filtered_q52 += (((speed_q52 - state->filtered_q52) >> 4) * settings->speed_filter_q16) >> (FILTER_BITS - 4);
  const int32_t share_q16 = (int32_t)state->validity.share_q16;
  // Without injection its validity does not count.
  int32_t limit = state->handover.inject ? mul_q16(settings->limit_i_q25, share_q16) : settings->limit_i_q25;
  if (state->rest.current_i_q25 != 0) {
    const int32_t beside = current_rest_i_q25(limit, state->rest.current_i_q25);
    limit = (beside > limit / FREE_SHARE) ? beside : limit / FREE_SHARE;
  }
  if (!in->by_speed) {
    state->wanted_i_q25 = clamp_i32(in->current_wanted_i_q25.im, -limit, limit);
    state->limited = state->wanted_i_q25 != in->current_wanted_i_q25.im;
    return;
  }
  const int32_t filtered = (int32_t)(state->filtered_q52 >> FILTER_BITS);
  const pi_result_t made = vector_speed_step(&state->speed, &settings->speed, in->speed_turn_q36, filtered, 0, limit);
  state->wanted_i_q25 = made.output;
  state->limited = made.output != made.unlimited;
}

// Curve of i_q in the published frame; by how much the frame goes the other way.
HOT static int32_t follow_curve(injection_frame_t *state, const injection_frame_settings_t *settings,
                                complex_t current_i_q25) {
  const complex_t published = complex_mul_q30(current_i_q25, complex_conj(state->turn_q30));
  (void)cross_coupling_step(&state->coupling, &settings->coupling, published.im);
  const int32_t before_q32 = state->curve_q32;
  state->curve_q32 = injection_handover_curve_q32(&state->handover, state->coupling.c_q32);
  if (state->curve_q32 != before_q32) {
    turn_references(state, settings);
  }
  return settings->coupling.following ? before_q32 - state->curve_q32 : 0;
}

// i_d that looks at the poles of the frame that is held.
COLD static int32_t test_i_q25(injection_frame_t *state, const injection_frame_settings_t *settings, int32_t d_i_q25,
                          complex_t vector_i_q21) {
  rest_position_again(&state->rest, &settings->rest, state->test);
  const rest_position_input_t given = {state->judge, vector_i_q21, d_i_q25, 0, 0};
  return rest_position_step(&state->rest, &settings->rest, &given).current_i_q25;
}

HOT void injection_frame_step(injection_frame_t *state, const injection_frame_settings_t *settings,
                              const injection_frame_input_t *in, injection_frame_command_t *command) {
  const bool fresh = in->fresh && !state->judge;
  if (fresh) {
    state->error_q30 = injection_error_q30(&settings->error, &in->amplitude);
  }
  if (state->resting) {
    *command = (injection_frame_command_t){.inject = true};
    const complex_t none = {0, 0};
    const complex_t vector_i_q21 = fresh ? injection_vector_i_q21(&settings->error, &in->amplitude) : none;
    const int32_t drift_q32 = (pll_speed_turn_q36(&state->pll) >> 4) * settings->tick_cycles;
    const rest_position_input_t given = {fresh, vector_i_q21, in->current_i_q25.re, state->turned_q32, drift_q32};
    const rest_position_command_t rest = rest_position_step(&state->rest, &settings->rest, &given);
    state->turned_q32 = 0;
    command->turn_q32 = rest.turn_q32;
    command->reference_i_q25[0] = (complex_t){rest.current_i_q25, 0};
    if (rest.track) {
      const int32_t correct_q32 = follow(state, settings, state->error_q30);
      command->turn_q32 = turned(command->turn_q32, correct_q32);
      state->turned_q32 = correct_q32 + (pll_speed_turn_q36(&state->pll) >> 4) * settings->tick_cycles;
    }
    state->resting = state->rest.phase != REST_FOUND;
  } else {
    injection_handover_step(&state->handover, &settings->handover, pll_speed_turn_q36(&state->pll), fresh,
                            in->emf_there);
    complex_t vector_i_q21 = {0, 0};
    if (state->judge) {
      vector_i_q21 = injection_vector_i_q21(&settings->error, &state->amplitude);
      injection_validity_step(&state->validity, &settings->validity, vector_i_q21);
    }
    int32_t d_i_q25 = in->current_wanted_i_q25.re;
    if (state->test || state->rest.current_i_q25 != 0) {
      d_i_q25 += test_i_q25(state, settings, in->current_i_q25.re, vector_i_q21);
    }
    state->judge = fresh;
    state->amplitude = in->amplitude;
    const int32_t error_q30 = injection_handover_error_q30(&state->handover, state->error_q30, in->emf_error_q30);
    command->turn_q32 = follow(state, settings, error_q30);
    regulate(state, settings, in);
    command->turn_q32 = turned(command->turn_q32, follow_curve(state, settings, in->current_i_q25));
    const complex_t wanted = {d_i_q25, state->wanted_i_q25};
    command->reference_i_q25[0] = complex_mul_q30(wanted, state->turn_q30);
    command->reference_i_q25[1] = (complex_t){0, 0};
    if (settings->third) {
      const complex_t third = {0, mul_q16(state->wanted_i_q25, settings->third_q16)};
      command->reference_i_q25[1] = complex_mul_q30(third, state->third_turn_q30);
    }
    command->inject = state->handover.inject;
  }
  command->speed_turn_q36 = pll_speed_turn_q36(&state->pll);
  const angle_sequence_leads_t leads =
      angle_sequence_leads(settings->sequence, &settings->machine, command->speed_turn_q36);
  command->lead_q32 = leads.lead_q32;
  command->report_q32 = leads.report_q32;
  command->curve_q32 = state->curve_q32;
}

SMALL_CODE_END
