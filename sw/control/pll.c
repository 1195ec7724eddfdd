#include "control/pll.h"

#include <stdbool.h>

#include "control/placement.h"

#define SPEED_BITS 24
#define TURN_MASK_Q36 (((uint64_t)1 << 36) - 1u)

SHARED static int64_t scale(int32_t x, gain_t g) { return round_shift((int64_t)x * g.mant, g.shift); }

// t / sqrt(1 + t^2) for 0 <= t = across / along < 1/5, within 1.2e-4; the reciprocal, to 14 bits, only scales it.
HOT static uint32_t small_sine_q30(uint32_t across, uint32_t along) {
  const uint32_t t_q30 = (uint32_t)(((uint64_t)across * ((uint32_t)ONE_Q30 / (along >> 16))) >> 16);
  const uint32_t square_q28 = (uint32_t)(((uint64_t)t_q30 * t_q30) >> 32);
  return t_q30 - (uint32_t)(((uint64_t)t_q30 * square_q28) >> 29);
}

// The length, to 14 bits, only scales the error; the part across keeps all of its bits.
HOT int32_t pll_error_q30(complex_t emf_v_q25, int32_t speed_turn_q36, uint32_t minimum_v_q25) {
  const uint32_t size = (uint32_t)abs_sat(emf_v_q25.re) | (uint32_t)abs_sat(emf_v_q25.im);
  if (size == 0u) {
    return 0;
  }
  // The longer part gets its top bit at 2^30.
  const int up = __builtin_clz(size) - 1;
  const uint32_t across = (uint32_t)abs_sat(emf_v_q25.re) << up;
  const uint32_t along = (uint32_t)abs_sat(emf_v_q25.im) << up;
  const bool backward = speed_turn_q36 < 0;
  const bool negative = (emf_v_q25.re > 0) != backward;
  const bool beyond = (emf_v_q25.im < 0) != backward;
  if (!beyond && across < along / 5u && along >> up >= minimum_v_q25) {
    const uint32_t error = small_sine_q30(across, along);
    return negative ? -(int32_t)error : (int32_t)error;
  }
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

void pll_preset(pll_t *pll, uint32_t angle_turn_q32, int32_t speed_turn_q36) {
  pll->angle_turn_q36 = (uint64_t)angle_turn_q32 << 4;
  pll->speed_turn_q60 = (int64_t)speed_turn_q36 * (1 << SPEED_BITS);
  pll->acceleration_turn_q60 = 0;
}

uint32_t pll_angle_turn_q32(const pll_t *pll) { return (uint32_t)(pll->angle_turn_q36 >> 4); }

int32_t pll_speed_turn_q36(const pll_t *pll) { return (int32_t)round_shift(pll->speed_turn_q60, SPEED_BITS); }

HOT int32_t pll_step(pll_t *pll, const pll_gains_t *gains, uint32_t period_cycles, int32_t error_q30) {
  const int64_t travel_q36 = (int64_t)pll_speed_turn_q36(pll) * (int32_t)period_cycles;
  const int32_t correction_q32 = (int32_t)scale(error_q30, gains->angle);
  const int64_t turn_q36 = travel_q36 + (int64_t)correction_q32 * 16;
  pll->angle_turn_q36 = (pll->angle_turn_q36 + (uint64_t)turn_q36) & TURN_MASK_Q36;
  const int64_t most = (int64_t)gains->speed_max_turn_q36 * (1 << SPEED_BITS);
  int64_t speed = pll->speed_turn_q60 + pll->acceleration_turn_q60 + scale(error_q30, gains->speed);
  if (gains->acceleration.mant != 0) {
    pll->acceleration_turn_q60 += scale(error_q30, gains->acceleration);
  }
  if (speed > most || speed < -most) {
    speed = (speed > most) ? most : -most;
    pll->acceleration_turn_q60 = 0;
  }
  pll->speed_turn_q60 = speed;
  return correction_q32;
}
