// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// PI regulator with feed-forward and anti-windup by back-calculation.
//
//   u   = feed_forward + kp*e + integral,  output = u limited to [low, high]
//   integral += ki*e + (output - u) / 8
//
// The caller passes the limits that really bind at this step (duty, current), so the integral follows
// them and not a fixed rail. The integral has PI_INTEGRAL_BITS bits below the output's format and saturates; the
// output's format therefore has to leave as many bits of headroom (voltage v_q25 does).
// Ranges: |feed_forward| <= 2 * PRODUCT_MAX, |low|, |high| <= PRODUCT_MAX.
#ifndef FL_PI_H
#define FL_PI_H

#include <stdint.h>

#include "control/fixed.h"

#define PI_INTEGRAL_BITS 5

typedef struct {
  int32_t integral_q5;  // output format with PI_INTEGRAL_BITS more fraction bits
} pi_state_t;

typedef struct {
  gain_t kp;  // error format -> output format
  gain_t ki;  // error format -> format of the integral, a step
} pi_gains_t;

typedef struct {
  int32_t output;
  int32_t unlimited;  // saturated u: the side on which output differs tells which limit bound
} pi_result_t;

// Set the integral so that the next step with this error and feed-forward gives `output`: bumpless entry.
void pi_preset(pi_state_t *state, gain_t kp, int32_t error, int32_t feed_forward, int32_t output);

// Add to the integral, in the output's format: what a feed-forward gives up.
void pi_shift(pi_state_t *state, int32_t added);

// One step, low <= high. About 130 clocks.
pi_result_t pi_step(pi_state_t *state, const pi_gains_t *gains, int32_t error, int32_t feed_forward, int32_t low,
                    int32_t high);

#endif
