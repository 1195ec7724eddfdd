// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/cross_coupling.h"

#include "control/placement.h"

SMALL_CODE_BEGIN

HOT static int32_t times_q29(int32_t c_q32, int32_t x_q29) {
  return (int32_t)round_shift((int64_t)c_q32 * x_q29, 29);
}

HOT int32_t cross_coupling_curve_q32(const cross_coupling_settings_t *settings, int32_t i_q25) {
  // gain_apply saturates at 2^29: that is i_max.
  const int32_t x_q29 = gain_apply(i_q25, settings->current);
  int32_t c_q32 = settings->c_q32[3];
  for (int k = 2; k >= 0; k--) {
    c_q32 = settings->c_q32[k] + times_q29(c_q32, x_q29);
  }
  return c_q32;
}

void cross_coupling_begin(cross_coupling_t *state, const cross_coupling_settings_t *settings, int32_t i_q25) {
  *state = (cross_coupling_t){i_q25, cross_coupling_curve_q32(settings, i_q25)};
}

HOT int32_t cross_coupling_step(cross_coupling_t *state, const cross_coupling_settings_t *settings, int32_t i_q25) {
  state->i_q25 = sat_i32(state->i_q25 + round_shift(((int64_t)i_q25 - state->i_q25) * settings->filter_q16, 16));
  const int32_t before_q32 = state->c_q32;
  state->c_q32 = cross_coupling_curve_q32(settings, state->i_q25);
  return settings->following ? before_q32 - state->c_q32 : 0;
}

SMALL_CODE_END
