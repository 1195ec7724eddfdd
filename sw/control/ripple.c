// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/ripple.h"

#include "control/placement.h"

#define MORE_BITS 8  // of the swing
#define ERROR_MAX (1 << 21)
#define TURN_TO_MU_Q32 1349296750u  // 2 z 2 pi, a half of it
#define QUARTER_TURN_Q30 ((int32_t)1 << 30)
#define FADE_SHIFT 3

// sin(2 pi x) to 0.1 %, by a parabola and its square.
HOT static int32_t rough_sine_q30(uint32_t turn_q32) {
  const int32_t x_q15 = (int32_t)turn_q32 >> 16;
  const int32_t y_q15 = (x_q15 * ((1 << 15) - abs_sat(x_q15))) >> 13;
  const int32_t square_q15 = (y_q15 * abs_sat(y_q15)) >> 15;
  return (y_q15 + (((square_q15 - y_q15) * 7373) >> 15)) * (1 << 15);
}

// One harmonic taken out of the error; turn: its, in a step.
HOT static int32_t notch(complex_t *h, complex_t c_q30, uint32_t turn_q32, int32_t error_q36) {
  if (turn_q32 > (uint32_t)QUARTER_TURN_Q30) {
    h->re -= h->re >> FADE_SHIFT;
    h->im -= h->im >> FADE_SHIFT;
    return error_q36;
  }
  const int32_t swing_q42 = mul_high_i32(h->re, c_q30.re) - mul_high_i32(h->im, c_q30.im);
  const int32_t left_q36 = error_q36 - (swing_q42 >> (MORE_BITS - 2));
  const int32_t mu_q31 = (int32_t)(((uint64_t)turn_q32 * TURN_TO_MU_Q32) >> 32);
  const int32_t change_q44 = mul_high_i32(left_q36 * (1 << MORE_BITS), mu_q31) * 2;
  h->re += mul_high_i32(change_q44, c_q30.re) * 4;
  h->im -= mul_high_i32(change_q44, c_q30.im) * 4;
  // The sum of all that the notch keeps of a step is 1 / (1 - mu / 2).
  return left_q36 - mul_high_i32(left_q36, mu_q31);
}

HOT int32_t ripple_step(ripple_t *ripple, int32_t error_turn_q36, int32_t speed_turn_q36, int32_t cycles,
                        uint32_t harmonics) {
  const int32_t turned_q32 = (int32_t)(((int64_t)ripple->speed_turn_q36 * cycles) >> 4);
  const uint32_t size_q32 = (uint32_t)within_i32(abs_sat(turned_q32), QUARTER_TURN_Q30 / 2 + 1);
  ripple->turn_q32 += (uint32_t)turned_q32;
  const uint32_t twice_q32 = ripple->turn_q32 * 2u;
  const complex_t c2 = {rough_sine_q30(twice_q32 + (uint32_t)QUARTER_TURN_Q30), rough_sine_q30(twice_q32)};
  const int32_t error = within_i32(error_turn_q36, ERROR_MAX);
  int32_t left = notch(&ripple->swing_turn_q44[0], c2, 2u * size_q32, error);
  if (harmonics > RIPPLE_SECOND) {
    // cos 2x = cos^2 x - sin^2 x, sin 2x = 2 cos x sin x; cos 3x = cos x (2 cos 2x - 1), sin 3x = sin x (2 cos 2x + 1).
    const int32_t twice_q28 = (mul_high_i32(c2.re, c2.re) - mul_high_i32(c2.im, c2.im)) * 2;
    if (harmonics == RIPPLE_ALL) {
      const complex_t c4 = {twice_q28 * 2, mul_high_i32(c2.re, c2.im) * 8};
      left = notch(&ripple->swing_turn_q44[1], c4, 4u * size_q32, left);
    }
    const complex_t c6 = {mul_high_i32(c2.re, twice_q28 - ONE_Q30 / 4) * 16,
                          mul_high_i32(c2.im, twice_q28 + ONE_Q30 / 4) * 16};
    left = notch(&ripple->swing_turn_q44[2], c6, 6u * size_q32, left);
  }
  ripple->speed_turn_q36 = speed_turn_q36 + error - left;
  return left + (error_turn_q36 - error);
}
