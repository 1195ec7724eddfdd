// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Complex current regulator: incremental recurrence with a voltage circle, the reference of the hardware's regulator.
//
//   w[k] = u[k-1] + (h/g) b[k-1] + g e[k] - h e[k-1],   e = i* - i,   h = g Phi   (Yang 2020, ch. 7)
//   u[k] = limit(w[k]),   b[k] = w[k] - u[k]
//
// e saturates at +-(2^17 - 1) an axis. The four products an axis (18 x 18 bit) are summed exactly, multiplied by
// 2^-shift and rounded half up once. The sum with u[k-1] saturates at 28 bits an axis, -2^27..2^27 - 1, which is four
// full scales: w. The limited u is the state: what the circle takes away is not integrated. b does what e[k-1] + (u - w)/g
// in place of e[k-1] would do (conditioning): the error counts that the circle allowed. It is rounded down to v_q15, its
// product with h/g half up to v_q25.
//
// Circle, limit >= 0 in v_q17: with d, q = u >> 8, rounded half up, m = floor(sqrt(d^2 + q^2)); if m > limit,
//   factor = floor(limit 2^17 / m),   u = u factor 2^-17, rounded half up an axis
// |u| stays below limit + 2 units of v_q17.
#ifndef FL_COMPLEX_REGULATOR_H
#define FL_COMPLEX_REGULATOR_H

#include <stdbool.h>
#include <stdint.h>

#include "control/complex_fixed.h"

// Mantissas signed 18 bit, one shift 0..31: current i_q17 -> voltage v_q25.
typedef struct {
  complex_t g;
  complex_t h;
  complex_t ratio_q17;  // h / g, 18 bit
  int32_t shift;
} regulator_gains_t;

typedef struct {
  complex_t voltage_v_q25;
  complex_t error_i_q17;
  complex_t carry_v_q25;  // (h/g) b
} complex_regulator_t;

// u limited to the circle; `limited` tells whether it was. 0 <= limit_v_q17 < 2^18. The square root is
// taken in the limited case only.
complex_t circle_limit_v_q25(complex_t voltage_v_q25, int32_t limit_v_q17, bool *limited);

// v_q25 -> v_q17, rounded half up.
static inline complex_t voltage_v_q17(complex_t voltage_v_q25) {
  return (complex_t){(voltage_v_q25.re + 128) >> 8, (voltage_v_q25.im + 128) >> 8};
}

// Continue from a voltage and an error: bumpless entry. 28 bits.
void complex_regulator_preset(complex_regulator_t *regulator, complex_t voltage_v_q25, complex_t error_i_q17);

// Go over to a frame turned by -arg(rotation): the vectors stay where they are in the machine. About 180 clocks.
void complex_regulator_turn(complex_regulator_t *regulator, complex_t rotation_q30);

// The two halves of a step, 18-bit currents: w, and what the circle leaves of it, which is the new state. The second
// returns whether the circle bound.
complex_t complex_regulator_want(complex_regulator_t *regulator, const regulator_gains_t *gains,
                                 complex_t reference_i_q17, complex_t current_i_q17);
bool complex_regulator_bound(complex_regulator_t *regulator, const regulator_gains_t *gains, complex_t wanted_v_q25,
                             int32_t limit_v_q17);

// One step, both halves; the new voltage is in the state.
bool complex_regulator_step(complex_regulator_t *regulator, const regulator_gains_t *gains, complex_t reference_i_q17,
                            complex_t current_i_q17, int32_t limit_v_q17);

#endif
