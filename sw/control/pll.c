// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/pll.h"

#include <stdbool.h>

#include "control/placement.h"

#define SPEED_BITS 24
#define NEAR_Q32 ((uint64_t)1 << 26)
#define TURN_MASK_Q36 (((uint64_t)1 << 36) - 1u)

// x g from the product's upper half: what the lower one would add is less than 2^-28 of an error of 1.
static inline int64_t scale(int32_t x, gain_t g) {
  const int32_t high = mul_high_i32(x, g.mant);
  if (g.shift > 32) {
    return ((high >> (g.shift - 33)) + 1) >> 1;
  }
  // On halves: a 64-bit shift by a variable costs three times as much.
  const int32_t up = 32 - g.shift;
  return (int64_t)((uint64_t)(uint32_t)((high >> 1) >> (31 - up)) << 32 | (uint32_t)high << up);
}

// 2^32 / d: a step of Newton's from the one of the last tick where that is near, else a division.
static inline uint32_t reciprocal_q32(uint32_t d, uint32_t *last) {
  const uint64_t excess_q32 = (uint64_t)d * *last - ((uint64_t)1 << 32);
  const bool near = excess_q32 + NEAR_Q32 < 2u * NEAR_Q32 && d > 2u;
  *last = near ? *last - (uint32_t)mul_high_i32((int32_t)*last, (int32_t)excess_q32) : UINT32_MAX / d;
  return *last;
}

// t / sqrt(1 + t^2) for 0 <= t = across / along < 1/5, within 1.2e-4; the reciprocal, to 13 bits, only scales it.
static inline uint32_t small_sine_q30(uint32_t across, uint32_t along, uint32_t *reciprocal) {
  const uint32_t drop = (along < (1u << 18)) ? 0u : (along < (1u << 22)) ? 4u : (along < (1u << 26)) ? 8u : 12u;
  const uint64_t product = (uint64_t)across * reciprocal_q32(along >> drop, reciprocal);
  const uint32_t t_q30 = ((uint32_t)(product >> 32) << (30u - drop)) | ((uint32_t)product >> (drop + 2u));
  const uint32_t square_q28 = (uint32_t)(((uint64_t)t_q30 * t_q30) >> 32);
  return t_q30 - (uint32_t)(((uint64_t)(t_q30 << 3) * square_q28) >> 32);
}

// The length, to 14 bits, only scales the error; the part across keeps all of its bits.
COLD static int32_t large_error_q30(uint32_t across, uint32_t along, bool negative, bool beyond,
                                      uint32_t minimum_v_q25) {
  if ((across | along) == 0u) {
    return 0;
  }
  // The longer part gets its top bit at 2^30.
  const int up = __builtin_clz(across | along) - 1;
  across <<= up;
  along <<= up;
  const uint32_t length_q16 = sqrt_u32((across >> 16) * (across >> 16) + (along >> 16) * (along >> 16));
  if ((length_q16 << 16) >> up < minimum_v_q25) {
    return 0;
  }
  uint32_t error = (uint32_t)ONE_Q30;
  if (!beyond) {
    const uint32_t sine_q30 = (uint32_t)(((uint64_t)across * ((uint32_t)ONE_Q30 / length_q16)) >> 16);
    error = (sine_q30 < error) ? sine_q30 : error;
  }
  return negative ? -(int32_t)error : (int32_t)error;
}

INLINED int32_t pll_error_from_q30(complex_t emf_v_q25, int32_t speed_turn_q36, uint32_t minimum_v_q25,
                                   uint32_t *reciprocal) {
  const uint32_t across = (emf_v_q25.re < 0) ? 0u - (uint32_t)emf_v_q25.re : (uint32_t)emf_v_q25.re;
  const uint32_t along = (emf_v_q25.im < 0) ? 0u - (uint32_t)emf_v_q25.im : (uint32_t)emf_v_q25.im;
  const bool backward = speed_turn_q36 < 0;
  const bool negative = (emf_v_q25.re > 0) != backward;
  const bool beyond = (emf_v_q25.im < 0) != backward;
  if (!beyond && across < along / 5u && along >= minimum_v_q25) {
    const uint32_t error = small_sine_q30(across, along, reciprocal);
    return negative ? -(int32_t)error : (int32_t)error;
  }
  return large_error_q30(across, along, negative, beyond, minimum_v_q25);
}

SHARED int32_t pll_error_q30(complex_t emf_v_q25, int32_t speed_turn_q36, uint32_t minimum_v_q25) {
  uint32_t reciprocal = 0;
  return pll_error_from_q30(emf_v_q25, speed_turn_q36, minimum_v_q25, &reciprocal);
}

void pll_preset(pll_t *pll, uint32_t angle_turn_q32, int32_t speed_turn_q36) {
  pll->angle_turn_q36 = (uint64_t)angle_turn_q32 << 4;
  pll->speed_turn_q60 = (int64_t)speed_turn_q36 * (1 << SPEED_BITS);
  pll->acceleration_turn_q60 = 0;
}

uint32_t pll_angle_turn_q32(const pll_t *pll) { return (uint32_t)(pll->angle_turn_q36 >> 4); }

int32_t pll_speed_turn_q36(const pll_t *pll) { return (int32_t)round_shift(pll->speed_turn_q60, SPEED_BITS); }

INLINED int32_t pll_correct(pll_t *pll, const pll_gains_t *gains, int32_t error_q30) {
  const int32_t correction_q32 = (int32_t)scale(error_q30, gains->angle);
  int64_t speed = pll->speed_turn_q60 + pll->acceleration_turn_q60 + scale(error_q30, gains->speed);
  if (gains->acceleration.mant != 0) {
    pll->acceleration_turn_q60 += scale(error_q30, gains->acceleration);
  }
  // Upper halves first.
  const int32_t below = gains->speed_max_turn_q36 >> (32 - SPEED_BITS);
  if (__builtin_expect((uint32_t)(int32_t)(speed >> 32) + (uint32_t)below >= 2u * (uint32_t)below, 0)) {
    const int64_t most = (int64_t)gains->speed_max_turn_q36 * (1 << SPEED_BITS);
    if (speed > most || speed < -most) {
      speed = (speed > most) ? most : -most;
      pll->acceleration_turn_q60 = 0;
    }
  }
  pll->speed_turn_q60 = speed;
  return correction_q32;
}

int32_t pll_step(pll_t *pll, const pll_gains_t *gains, uint32_t period_cycles, int32_t error_q30) {
  const int64_t travel_q36 = (int64_t)pll_speed_turn_q36(pll) * (int32_t)period_cycles;
  const int32_t correction_q32 = pll_correct(pll, gains, error_q30);
  const int64_t turn_q36 = travel_q36 + (int64_t)correction_q32 * 16;
  pll->angle_turn_q36 = (pll->angle_turn_q36 + (uint64_t)turn_q36) & TURN_MASK_Q36;
  return correction_q32;
}
