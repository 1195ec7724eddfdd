// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/vector_speed.h"

#include "control/placement.h"
#include "control/trig.h"

static int32_t speed_error(int32_t reference_turn_q36, int32_t speed_turn_q36) {
  return sat_i32((int64_t)reference_turn_q36 - speed_turn_q36);
}

HOT int32_t current_rest_i_q25(int32_t amplitude_i_q25, int32_t other_i_q25) {
  if (abs_sat(other_i_q25) >= amplitude_i_q25) {
    return 0;
  }
  const int64_t square = (int64_t)amplitude_i_q25 * amplitude_i_q25 - (int64_t)other_i_q25 * other_i_q25;
  return (int32_t)sqrt_u64((uint64_t)square);
}

void vector_speed_preset(pi_state_t *state, const pi_gains_t *gains, int32_t reference_turn_q36,
                         int32_t speed_turn_q36, int32_t current_i_q25) {
  pi_preset(state, gains->kp, speed_error(reference_turn_q36, speed_turn_q36), 0, current_i_q25);
}

HOT pi_result_t vector_speed_between(pi_state_t *state, const pi_gains_t *gains, int32_t error_turn_q36,
                                     int32_t ahead_i_q25, int32_t low, int32_t high) {
  const int32_t unlimited = ahead_i_q25 + gain_apply(error_turn_q36, gains->kp) + (state->integral_q5 >> PI_INTEGRAL_BITS);
  const int32_t output = clamp_i32(unlimited, low, high);
  if (output == unlimited || (output > unlimited) == (error_turn_q36 > 0)) {
    const int32_t integral_q5 = state->integral_q5 + gain_apply(error_turn_q36, gains->ki);
    state->integral_q5 = clamp_i32(integral_q5, low * (1 << PI_INTEGRAL_BITS), high * (1 << PI_INTEGRAL_BITS));
  }
  return (pi_result_t){output, unlimited};
}

HOT pi_result_t vector_speed_step(pi_state_t *state, const pi_gains_t *gains, int32_t reference_turn_q36,
                                  int32_t speed_turn_q36, int32_t feed_forward_i_q25, int32_t limit_i_q25) {
  const int32_t error = speed_error(reference_turn_q36, speed_turn_q36);
  return pi_step(state, gains, error, feed_forward_i_q25, -limit_i_q25, limit_i_q25);
}
