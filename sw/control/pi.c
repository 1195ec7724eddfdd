// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/pi.h"

#include "control/placement.h"

// (output - u) / 8 in the format of the integral.
#define BACK_CALCULATION_BITS (PI_INTEGRAL_BITS - 3)

// Together with one change of at most 2 * PRODUCT_MAX it stays within 32 bits.
#define INTEGRAL_MAX ((1 << 30) - 1)

// x * 2^bits, limited to PRODUCT_MAX.
static int32_t shift_sat(int32_t x, int32_t bits) {
  const int32_t most = PRODUCT_MAX >> bits;
  return clamp_i32(x, -most, most) * (1 << bits);
}

COLD void pi_preset(pi_state_t *state, gain_t kp, int32_t error, int32_t feed_forward, int32_t output) {
  const int32_t rest = output - feed_forward - gain_apply(error, kp);
  state->integral_q5 = shift_sat(rest, PI_INTEGRAL_BITS);
}

void pi_shift(pi_state_t *state, int32_t added) {
  state->integral_q5 = clamp_i32(state->integral_q5 + shift_sat(added, PI_INTEGRAL_BITS), -INTEGRAL_MAX, INTEGRAL_MAX);
}

HOT pi_result_t pi_step(pi_state_t *state, const pi_gains_t *gains, int32_t error, int32_t feed_forward, int32_t low,
                        int32_t high) {
  pi_result_t result;
  const int32_t integral = state->integral_q5 >> PI_INTEGRAL_BITS;
  result.unlimited = feed_forward + gain_apply(error, gains->kp) + integral;
  result.output = clamp_i32(result.unlimited, low, high);
  const int32_t excess = result.output - result.unlimited;
  const int32_t change = gain_apply(error, gains->ki) + shift_sat(excess, BACK_CALCULATION_BITS);
  state->integral_q5 = clamp_i32(state->integral_q5 + change, -INTEGRAL_MAX, INTEGRAL_MAX);
  return result;
}
