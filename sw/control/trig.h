// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Sine, cosine, arc tangent, length of a vector and exponential decay in fixed point.
//
// Angles are unsigned, 2^32 = one turn. Polynomials are Taylor series after reduction to an eighth of a turn (sine,
// cosine), to |tan| <= tan 22.5 degrees (arc tangent) and to arguments below 1 (decay); cut where the rest is below
// 2^-32 of a unit.
#ifndef FL_TRIG_H
#define FL_TRIG_H

#include <stdint.h>

#include "control/complex_fixed.h"

// exp(j theta), both parts within 2e-9 (two units). About 150 clocks.
complex_t cis_q30(uint32_t angle_turn_q32);

// Angle of a vector to 5 * 2^-32 of a turn, besides what the resolution of the parts makes; 0 for the zero vector.
// About 400 clocks.
uint32_t complex_angle_turn_q32(complex_t z);

// floor(sqrt(n)). About 320 clocks.
uint32_t sqrt_u64(uint64_t n);

// Length of a vector, floor. About 340 clocks.
uint32_t complex_abs(complex_t z);

typedef struct {
  int32_t factor_q30;  // exp(-x)
  int32_t slope_q30;   // (1 - exp(-x)) / x, 1 at x = 0
} decay_t;

// Both for 0 <= x < 2, within 3e-9. About 160 clocks.
decay_t decay_q30(uint32_t x_q30);

#endif
