// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/injection_validity.h"

#include <stdbool.h>

#include "control/fixed.h"
#include "control/placement.h"

#define WHOLE_Q16 ((uint32_t)1 << 16)
#define MORE_BITS 16

SMALL_CODE_BEGIN

void injection_validity_begin(injection_validity_t *state) { *state = (injection_validity_t){.share_q16 = WHOLE_Q16}; }

// 0 at `from` to 1 at `to`, from < to.
static uint32_t part_q16(uint32_t value, uint32_t from, uint32_t to) {
  if (value <= from) {
    return 0;
  }
  return (value >= to) ? WHOLE_Q16 : div_sat_u32((uint64_t)(value - from) << 16, to - from);
}

static uint32_t product_q16(uint32_t value_q16, uint64_t numerator, uint32_t denominator) {
  return div_sat_u32(numerator * value_q16, denominator);
}

static injection_verdict_t judge(injection_validity_t *state, const injection_validity_settings_t *settings) {
  const int32_t mean_i_q21 = (int32_t)(state->mean_i_q37 >> MORE_BITS);
  if (mean_i_q21 < settings->minimum_i_q21 || mean_i_q21 <= 0) {
    state->share_q16 = 0;
    return INJECTION_NO_SIGNAL;
  }
  const uint32_t scatter_i_q21 = (uint32_t)(state->scatter_i_q37 >> MORE_BITS);
  state->noise_q16 = product_q16(settings->noise_factor_q16, scatter_i_q21, (uint32_t)mean_i_q21);
  state->ratio_q16 = product_q16(settings->saliency_q16, (uint32_t)mean_i_q21, (uint32_t)settings->expected_i_q21);
  const uint32_t by_noise = WHOLE_Q16 - part_q16(state->noise_q16, settings->derate_noise_q16, settings->fault_noise_q16);
  const uint32_t by_ratio = part_q16(state->ratio_q16, settings->fault_ratio_q16, settings->derate_ratio_q16);
  state->share_q16 = (by_noise < by_ratio) ? by_noise : by_ratio;
  if (by_ratio == 0u) {
    return INJECTION_NO_SALIENCY;
  }
  if (by_noise == 0u) {
    return INJECTION_NOISE;
  }
  return (state->share_q16 < WHOLE_Q16) ? INJECTION_DERATED : INJECTION_GOOD;
}

void injection_validity_step(injection_validity_t *state, const injection_validity_settings_t *settings,
                             complex_t vector_i_q21) {
  const int64_t d_i_q37 = (int64_t)abs_sat(vector_i_q21.re) << MORE_BITS;
  const complex_t change = complex_sub(vector_i_q21, state->last_i_q21);
  const int64_t jump_i_q37 = ((int64_t)abs_sat(change.re) + abs_sat(change.im)) << MORE_BITS;
  state->last_i_q21 = vector_i_q21;
  if (state->seen == 0u) {
    state->mean_i_q37 = d_i_q37;
    state->seen = 1;
    return;
  }
  state->mean_i_q37 += (d_i_q37 - state->mean_i_q37) >> settings->filter_shift;
  state->scatter_i_q37 += (jump_i_q37 - state->scatter_i_q37) >> settings->filter_shift;
  if (state->seen < 2u << settings->filter_shift) {
    state->seen++;
    return;
  }
  if (state->verdict >= INJECTION_NO_SIGNAL) {
    return;
  }
  const injection_verdict_t verdict = judge(state, settings);
  if (verdict >= INJECTION_NO_SIGNAL) {
    state->bad++;
  } else if (state->bad > 0u) {
    state->bad--;
  }
  const bool fault = state->bad >= settings->fault_results;
  state->verdict = (verdict >= INJECTION_NO_SIGNAL && !fault) ? INJECTION_DERATED : verdict;
}

const char *injection_verdict_name(injection_verdict_t verdict) {
  static const char *const names[] = {"good", "derated", "no_signal", "noise", "no_saliency"};
  return names[verdict];
}

SMALL_CODE_END
