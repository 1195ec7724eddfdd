// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/ripple.h"

#include "control/placement.h"

#define MORE_BITS 8  // of the swing
#define ERROR_MAX (1 << 21)
#define QUARTER_TURN_Q32 ((int64_t)1 << 30)
#define TURN_TO_MU_Q32 1349296750u  // 2 z 2 pi, a half of it
#define FADE_SHIFT 3

static const uint8_t orders[RIPPLE_HARMONICS] = {2u, 4u, 6u};

// sin(2 pi x) to 0.1 %, by a parabola and its square.
HOT static int32_t rough_sine_q30(uint32_t turn_q32) {
  const int32_t x_q15 = (int32_t)turn_q32 >> 16;
  const int32_t y_q15 = (x_q15 * ((1 << 15) - abs_sat(x_q15))) >> 13;
  const int32_t square_q15 = (y_q15 * abs_sat(y_q15)) >> 15;
  return (y_q15 + (((square_q15 - y_q15) * 7373) >> 15)) * (1 << 15);
}

HOT int32_t ripple_step(ripple_t *ripple, int32_t error_turn_q36, int32_t speed_turn_q36, int32_t cycles) {
  const int64_t turned_q36 = (int64_t)ripple->speed_turn_q36 * cycles;
  const int64_t size_q32 = ((turned_q36 < 0) ? -turned_q36 : turned_q36) >> 4;
  ripple->turn_q32 += (uint32_t)(turned_q36 >> 4);
  const int32_t error = within_i32(error_turn_q36, ERROR_MAX);
  int32_t left = error;
  for (uint32_t k = 0; k < RIPPLE_HARMONICS; k++) {
    const int32_t order = orders[k];
    complex_t *h = &ripple->swing_turn_q44[k];
    if (order * size_q32 > QUARTER_TURN_Q32) {
      h->re -= h->re >> FADE_SHIFT;
      h->im -= h->im >> FADE_SHIFT;
      continue;
    }
    const uint32_t turn_q32 = ripple->turn_q32 * (uint32_t)order;
    const complex_t c = {rough_sine_q30(turn_q32 + ((uint32_t)1 << 30)), rough_sine_q30(turn_q32)};
    const int32_t swing_q42 = mul_high_i32(h->re, c.re) - mul_high_i32(h->im, c.im);
    left -= swing_q42 >> (MORE_BITS - 2);
    const int32_t mu_q31 = (int32_t)(((uint64_t)(uint32_t)(order * size_q32) * TURN_TO_MU_Q32) >> 32);
    const int32_t change_q44 = mul_high_i32(left * (1 << MORE_BITS), mu_q31) * 2;
    h->re += mul_high_i32(change_q44, c.re) * 4;
    h->im -= mul_high_i32(change_q44, c.im) * 4;
    // The sum of all that the notch keeps of a step is 1 / (1 - mu / 2).
    left -= mul_high_i32(left, mu_q31);
  }
  ripple->speed_turn_q36 = speed_turn_q36 + error - left;
  return left + (error_turn_q36 - error);
}
