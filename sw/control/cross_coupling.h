// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Cross-coupling of the axes: under load the saliency axis, which the injection follows, and the d axis part. A curve of
// i_q, c = theta - theta of the saliency, compensates it (Yu 2022):
//
//   c(i_q) = c0 + c1 x + c2 x^2 + c3 x^3,   x = i_q / i_max, held at +-1
//
// The chip's frame stays on the saliency axis: injection and demodulation would undo a turned one. Published is its angle
// plus c; references of the fundamental are turned into the frame by exp(j c), currents and voltages out of it by
// exp(-j c), of the third subspace by three times as much.
//
// i_q is filtered first. "Following": when c changes, the frame moves by as much the other way, so that the published
// angle does not jump and the loop need not run after it.
#ifndef FL_CROSS_COUPLING_H
#define FL_CROSS_COUPLING_H

#include <stdint.h>

#include "control/complex_fixed.h"
#include "control/fixed.h"

typedef struct {
  int32_t c_q32[4];    // 2^32 = one turn; the sums of their sizes below a quarter turn
  gain_t current;      // i_q25 -> x_q29: 2^29 / i_max
  int32_t filter_q16;  // share of the new current a step, 0..2^16
  int32_t following;   // 1: the frame moves with the curve
} cross_coupling_settings_t;

typedef struct {
  int32_t i_q25;    // filtered
  int32_t c_q32;    // in use
} cross_coupling_t;

// The curve itself, 2^32 = one turn, within 4 units. About 80 clocks.
int32_t cross_coupling_curve_q32(const cross_coupling_settings_t *settings, int32_t i_q25);

// Start with a current.
void cross_coupling_begin(cross_coupling_t *state, const cross_coupling_settings_t *settings, int32_t i_q25);

// One step with i_q of the published frame. Returns by how much the chip's frame has to turn. About 110 clocks.
int32_t cross_coupling_step(cross_coupling_t *state, const cross_coupling_settings_t *settings, int32_t i_q25);

#endif
