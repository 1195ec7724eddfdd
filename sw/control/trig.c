// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/trig.h"

#include <stdbool.h>

#include "control/placement.h"

#define EIGHTH_TURN 0x20000000u
#define TAN_22_5_Q32 1779033704u

// floor(a * b / 2^32)
static inline uint32_t mul_high(uint32_t a, uint32_t b) { return (uint32_t)(((uint64_t)a * b) >> 32); }

// c[0] - z (c[1] - z (c[2] - ...)), 0 <= z < 1, every bracket in 0..1; all Q0.32.
static inline uint32_t alternating_q32(const uint32_t *c, uint32_t count, uint32_t z_q32) {
  uint32_t sum = c[count - 1u];
  for (uint32_t k = count - 1u; k > 0u; k--) {
    sum = c[k - 1u] - mul_high(z_q32, sum);
  }
  return sum;
}

// (pi/4)^n / n!, the powers of the sine and, from the square on, of the cosine.
static const uint32_t SINE_Q32[] = {3373259426u, 346799334u, 10696163u, 157094u, 1346u, 8u};
static const uint32_t COSINE_Q32[] = {1324675879u, 68093890u, 1400124u, 15423u, 106u};

HOT complex_t cis_q30(uint32_t angle_turn_q32) {
  const uint32_t quadrant = (angle_turn_q32 + EIGHTH_TURN) >> 30;
  const int32_t rest = (int32_t)(angle_turn_q32 - (quadrant << 30));
  // In eighths of a turn, 0..1; exactly 1 becomes one unit less.
  uint32_t u_q31 = ((rest < 0) ? 0u - (uint32_t)rest : (uint32_t)rest) << 2;
  u_q31 -= u_q31 >> 31;
  const uint32_t z_q32 = (uint32_t)(((uint64_t)u_q31 * u_q31) >> 30);
  const uint32_t slope_q32 = alternating_q32(SINE_Q32, 6, z_q32);
  const uint32_t drop_q32 = alternating_q32(COSINE_Q32, 5, z_q32);
  const int32_t size = (int32_t)(((uint64_t)u_q31 * slope_q32 + ((uint64_t)1 << 32)) >> 33);
  const int32_t sine = (rest < 0) ? -size : size;
  const int32_t cosine = ONE_Q30 - (int32_t)(((uint64_t)z_q32 * drop_q32 + ((uint64_t)1 << 33)) >> 34);
  switch (quadrant & 3u) {
    case 0:
      return (complex_t){cosine, sine};
    case 1:
      return (complex_t){-sine, cosine};
    case 2:
      return (complex_t){-cosine, -sine};
    default:
      return (complex_t){sine, -cosine};
  }
}

// 1 / (2 pi (2 k + 1))
static const uint32_t ARC_TANGENT_Q32[] = {683565276u, 227855092u, 136713055u, 97652182u, 75951697u, 62142298u,
                                           52581944u,  45571018u,  40209722u,  35977120u, 32550727u};

// Arc tangent of n / d <= tan 22.5 degrees, d > 0.
static uint32_t arc_tangent_turn_q32(uint32_t n, uint32_t d) {
  const uint32_t tangent_q32 = div_sat_u32((uint64_t)n << 32, d);
  const uint32_t z_q32 = mul_high(tangent_q32, tangent_q32);
  return mul_high(tangent_q32, alternating_q32(ARC_TANGENT_Q32, 11, z_q32));
}

HOT uint32_t complex_angle_turn_q32(complex_t z) {
  uint32_t ax = (z.re < 0) ? 0u - (uint32_t)z.re : (uint32_t)z.re;
  uint32_t ay = (z.im < 0) ? 0u - (uint32_t)z.im : (uint32_t)z.im;
  const bool steep = ay > ax;
  uint32_t far = steep ? ay : ax;
  uint32_t near = steep ? ax : ay;
  if (far == 0u) {
    return 0;
  }
  const int up = __builtin_clz(far);
  far <<= up;
  near <<= up;
  uint32_t angle;
  if (near <= mul_high(far, TAN_22_5_Q32)) {
    angle = arc_tangent_turn_q32(near, far);
  } else {
    // 45 degrees less the angle to the diagonal.
    angle = EIGHTH_TURN - arc_tangent_turn_q32((far - near) >> 1, (far >> 1) + (near >> 1));
  }
  angle = steep ? 2u * EIGHTH_TURN - angle : angle;
  angle = (z.re < 0) ? 4u * EIGHTH_TURN - angle : angle;
  return (z.im < 0) ? 0u - angle : angle;
}

// Root of the upper half first, then a quotient for the lower 16 bits of the root, too large by one at most.
HOT uint32_t sqrt_u64(uint64_t n) {
  const uint32_t top = (uint32_t)(n >> 32);
  if (top == 0u) {
    return sqrt_u32((uint32_t)n);
  }
  const uint32_t up = (uint32_t)__builtin_clz(top) & ~1u;
  const uint64_t scaled = n << up;
  const uint32_t high = (uint32_t)(scaled >> 32);
  const uint32_t root_high = sqrt_u32(high);
  const uint32_t rest = high - root_high * root_high;
  const uint32_t digit = ((rest << 15) + ((uint32_t)scaled >> 17)) / root_high;
  uint32_t root = (root_high << 16) + ((digit > 0xFFFFu) ? 0xFFFFu : digit);
  if ((uint64_t)root * root > scaled) {
    root--;
  }
  return root >> (up / 2u);
}

HOT uint32_t complex_abs(complex_t z) {
  return sqrt_u64((uint64_t)((int64_t)z.re * z.re) + (uint64_t)((int64_t)z.im * z.im));
}

// 1 / k! from k = 2 on
static const uint32_t DECAY_Q32[] = {2147483648u, 715827883u, 178956971u, 35791394u, 5965232u, 852176u,
                                     106522u,     11836u,     1184u,      108u,      9u,       1u};

// y = x / 2 first: slope(x) = slope(y) (1 + exp(-y)) / 2.
HOT decay_t decay_q30(uint32_t x_q30) {
  const uint32_t one_q31 = 0x80000000u;
  const uint32_t y_q32 = x_q30 << 1;
  const uint32_t slope_q31 = one_q31 - (mul_high(y_q32, alternating_q32(DECAY_Q32, 12, y_q32)) >> 1);
  const uint32_t factor_q31 = one_q31 - mul_high(y_q32, slope_q31);
  decay_t result;
  result.factor_q30 = (int32_t)(((uint64_t)factor_q31 * factor_q31 + one_q31) >> 32);
  result.slope_q30 = (int32_t)(((uint64_t)slope_q31 * ((uint64_t)one_q31 + factor_q31) + ((uint64_t)1 << 32)) >> 33);
  return result;
}
