// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/fixed.h"

#include "control/placement.h"

// The shift works on 32-bit halves: a 64-bit shift by a variable costs three times as much.
HOT int32_t gain_apply(int32_t x, gain_t g) {
  const int64_t product = (int64_t)x * g.mant;
  const int32_t high = (int32_t)(product >> 32);
  int32_t twice;  // the result with one more bit, for the rounding
  if (g.shift > 32) {
    twice = high >> (g.shift - 33);
  } else {
    const int32_t bound = 1 << (g.shift - 3);
    if (__builtin_expect((uint32_t)high + (uint32_t)bound >= 2u * (uint32_t)bound, 0)) {
      return (high < 0) ? -PRODUCT_MAX : PRODUCT_MAX;
    }
    twice = (int32_t)(((uint32_t)high << (33 - g.shift)) | ((uint32_t)product >> (g.shift - 1)));
  }
  return within_i32((twice + 1) >> 1, PRODUCT_MAX);
}

HOT int32_t mul_q16(int32_t x, int32_t factor_q16) {
  return (int32_t)(((int64_t)x * factor_q16 + 32768) >> 16);
}

// One 16-bit digit of a quotient by a normalised divisor (top bit set): *rest < d on entry and on exit.
// The trial digit from the upper halves is too large by at most two.
HOT static uint32_t quotient_digit(uint32_t *rest, uint32_t next16, uint32_t d) {
  const uint32_t d_high = d >> 16;
  const uint32_t d_low = d & 0xFFFFu;
  uint32_t digit = *rest / d_high;
  uint32_t left = *rest - digit * d_high;
  while (digit > 0xFFFFu || digit * d_low > ((left << 16) | next16)) {
    digit--;
    left += d_high;
    if (left > 0xFFFFu) {
      break;
    }
  }
  *rest = ((*rest << 16) | next16) - digit * d;
  return digit;
}

HOT uint32_t div_sat_u32(uint64_t n, uint32_t d) {
  if (d == 0u || (uint32_t)(n >> 32) >= d) {
    return UINT32_MAX;
  }
  const int up = __builtin_clz(d);
  const uint64_t scaled = n << up;  // n >> 32 < d, so nothing is lost
  const uint32_t divisor = d << up;
  const uint32_t low = (uint32_t)scaled;
  uint32_t rest = (uint32_t)(scaled >> 32);
  const uint32_t high_digit = quotient_digit(&rest, low >> 16, divisor);
  const uint32_t low_digit = quotient_digit(&rest, low & 0xFFFFu, divisor);
  return (high_digit << 16) | low_digit;
}

uint64_t div_u64(uint64_t n, uint32_t d) {
  const uint32_t high = (uint32_t)(n >> 32);
  const uint32_t q_high = high / d;
  const uint32_t rest = high % d;
  return ((uint64_t)q_high << 32) | div_sat_u32(((uint64_t)rest << 32) | (uint32_t)n, d);
}

uint32_t sqrt_u32(uint32_t n) {
  uint32_t root = 0;
  for (uint32_t bit = 1u << 30; bit != 0u; bit >>= 2) {
    const uint32_t trial = root + bit;
    root >>= 1;
    if (n >= trial) {
      n -= trial;
      root += bit;
    }
  }
  return root;
}
