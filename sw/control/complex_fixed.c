// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/complex_fixed.h"

#include "control/placement.h"

#define HALF_Q30 ((int64_t)1 << 29)

static int32_t to_q30(int64_t product) { return sat_i32((product + HALF_Q30) >> 30); }

HOT complex_t complex_mul_q30(complex_t a, complex_t b_q30) {
  const int64_t re = (int64_t)a.re * b_q30.re - (int64_t)a.im * b_q30.im;
  const int64_t im = (int64_t)a.re * b_q30.im + (int64_t)a.im * b_q30.re;
  return (complex_t){to_q30(re), to_q30(im)};
}

HOT complex_t complex_scale_q30(complex_t a, int32_t factor_q30) {
  return (complex_t){to_q30((int64_t)a.re * factor_q30), to_q30((int64_t)a.im * factor_q30)};
}

HOT complex_t complex_gain_apply(complex_t z, complex_gain_t g) {
  const int64_t re = (int64_t)z.re * g.re - (int64_t)z.im * g.im;
  const int64_t im = (int64_t)z.re * g.im + (int64_t)z.im * g.re;
  return (complex_t){sat_i32(round_shift(re, g.shift)), sat_i32(round_shift(im, g.shift))};
}

HOT complex_gain_t complex_inverse(complex_t z) {
  const uint32_t size = (uint32_t)abs_sat(z.re) | (uint32_t)abs_sat(z.im);
  if (size == 0u) {
    return (complex_gain_t){ONE_Q30, 0, 30};
  }
  // n = z 2^up has its longer part in 2^29..2^30.
  const int32_t up = __builtin_clz(size) - 2;
  int32_t re = (up >= 0) ? z.re * (1 << up) : z.re / 2;
  int32_t im = (up >= 0) ? z.im * (1 << up) : z.im / 2;
  const uint64_t square = (uint64_t)((int64_t)re * re) + (uint64_t)((int64_t)im * im);
  // 1/n = conj(n) / |n|^2 = conj(n) (2^60 / (|n|^2 2^-29)) 2^-89.
  const uint32_t inverse = div_sat_u32((uint64_t)1 << 60, (uint32_t)(square >> 29));
  re = to_q30((int64_t)re * inverse);
  im = to_q30((int64_t)im * inverse);
  return (complex_gain_t){re, -im, 59 - up};
}
