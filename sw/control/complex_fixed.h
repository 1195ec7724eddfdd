// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Complex fixed point: d + jq and factors of such. The format stands in the name of the variable; both parts share it.
// Parts lie within +-(2^31 - 1); conjugates, sums and differences are exact and must fit 32 bits.
// Clocks, here and in what builds on it, are the worst of random calls, counted with product 3, division 35, load 2 and
// taken branch 3 clocks, everything in the cache.
#ifndef FL_COMPLEX_FIXED_H
#define FL_COMPLEX_FIXED_H

#include <stdint.h>

#include "control/fixed.h"

typedef struct {
  int32_t re;
  int32_t im;
} complex_t;

// A complex factor (re + j im) * 2^-shift. Normalised: 2^28 < max(|re|, |im|) < 2^31.
typedef struct {
  int32_t re;
  int32_t im;
  int32_t shift;
} complex_gain_t;

#define ONE_Q30 ((int32_t)1 << 30)

static inline complex_t complex_conj(complex_t z) { return (complex_t){z.re, -z.im}; }

static inline complex_t complex_add(complex_t a, complex_t b) { return (complex_t){a.re + b.re, a.im + b.im}; }

static inline complex_t complex_sub(complex_t a, complex_t b) { return (complex_t){a.re - b.re, a.im - b.im}; }

// a * b in the format of a, rounded half up and saturated. About 90 clocks.
complex_t complex_mul_q30(complex_t a, complex_t b_q30);

// a * factor, -2 <= factor < 2. About 70 clocks.
complex_t complex_scale_q30(complex_t a, int32_t factor_q30);

// z * g, rounded half up and saturated; |z| |g mantissa| < 2^62, 0 <= shift <= 62. About 130 clocks.
complex_t complex_gain_apply(complex_t z, complex_gain_t g);

// 1 / z to 2^-27 of its length, for z as integers, |re|, |im| <= 2^31 - 1: the format of z counts in the shift. z = 0
// counts as 1. About 370 clocks.
complex_gain_t complex_inverse(complex_t z);

#endif
