// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Fixed-point helpers: saturation, gains with a binary exponent, 64-bit division without a library.
//
// Formats used throughout the firmware (the suffix of a name is its format):
//   _rpm_q8   mechanical speed, signed, 1/256 r/min
//   _v_q25    voltage, signed, 2^25 = full scale of the voltage converter
//   _q17      corrected sample, signed, 2^17 = full scale of its converter
//   _duty_q30 duty, signed, 2^30 = always on
//   _q16      dimensionless, 2^16 = 1
//   _cycles   clocks of the chip
#ifndef FL_FIXED_H
#define FL_FIXED_H

#include <stdint.h>

// A real factor mant * 2^-shift, 4 <= shift <= 62. Normalised gains (|mant| >= 2^30) keep 30 bits.
typedef struct {
  int32_t mant;
  int32_t shift;
} gain_t;

#define FULL_Q17 (1 << 17)            // full scale of a converter
#define SAMPLE_MAX_Q17 (FULL_Q17 - 1)  // largest sample

// By halves, which the compiler must not join again: with 64-bit comparisons each of the many places takes twice the code.
static inline int32_t sat_i32(int64_t x) {
  const int32_t low = (int32_t)x;
  int32_t high = (int32_t)(x >> 32);
  __asm__("" : "+r"(high));
  return (high == (low >> 31)) ? low : (high >> 31) ^ INT32_MAX;
}

static inline int32_t clamp_i32(int32_t x, int32_t low, int32_t high) {
  if (x < low) {
    return low;
  }
  return (x > high) ? high : x;
}

// x limited to +-most, 0 <= most <= 2^30: one comparison for what is within.
static inline int32_t within_i32(int32_t x, int32_t most) {
  if (__builtin_expect((uint32_t)x + (uint32_t)most > 2u * (uint32_t)most, 0)) {
    return (x < 0) ? -most : most;
  }
  return x;
}

static inline uint32_t clamp_u32(uint32_t x, uint32_t low, uint32_t high) {
  if (x < low) {
    return low;
  }
  return (x > high) ? high : x;
}

// floor(a * b / 2^32)
static inline int32_t mul_high_i32(int32_t a, int32_t b) { return (int32_t)(((int64_t)a * b) >> 32); }

// |a|, at most INT32_MAX; without a branch.
static inline int32_t abs_sat(int32_t a) {
  const uint32_t sign = (a < 0) ? UINT32_MAX : 0u;
  const uint32_t size = ((uint32_t)a ^ sign) - sign;
  return (int32_t)(size - (size >> 31));
}

// x * 2^-shift rounded to nearest, 0 <= shift <= 62, |x| <= 2^62.
static inline int64_t round_shift(int64_t x, int32_t shift) {
  return (shift > 0) ? ((x + ((int64_t)1 << (shift - 1))) >> shift) : x;
}

// Products saturate at +-PRODUCT_MAX, so that three of them, and what is below 2^29, add up without overflow.
#define PRODUCT_MAX ((1 << 29) - 1)

// x * g, rounded and saturated at +-PRODUCT_MAX. About 35 clocks.
int32_t gain_apply(int32_t x, gain_t g);

// x * factor_q16, rounded, for results within 32 bits. About 20 clocks.
int32_t mul_q16(int32_t x, int32_t factor_q16);

// floor(n / d) saturated to 32 bits; d = 0 saturates too. Two hardware divisions, about 130 clocks.
uint32_t div_sat_u32(uint64_t n, uint32_t d);

// floor(n / d), d > 0, and the full 64-bit quotient. About 200 clocks.
uint64_t div_u64(uint64_t n, uint32_t d);

// floor(sqrt(n)). About 140 clocks.
uint32_t sqrt_u32(uint32_t n);

#endif
