// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Current limiter: an upper bound for the voltage, from the machine's model with a bounded trim.
//
//   bound = emf + R*I_limit + kp*margin + trim,   margin = least distance of a current to its limit
//   trim += ki*margin while the bound is the active limit, |trim| <= R*I_limit / 2, else it decays to 0
//
// The model makes the bound right within its parameter errors at once; the trim takes the rest.
#ifndef FL_LIMITER_H
#define FL_LIMITER_H

#include <stdbool.h>
#include <stdint.h>

#include "control/fixed.h"

typedef struct {
  int32_t trim_v_q25;
} limiter_t;

typedef struct {
  gain_t kp;  // current q17 -> voltage q25
  gain_t ki;  // current q17 -> voltage q25 a step
} limiter_gains_t;

// Bound for this step. resistive_v_q25 = R*I_limit >= 0; emf and resistive are products (|x| <= PRODUCT_MAX).
// About 60 clocks.
int32_t limiter_bound(const limiter_t *limiter, const limiter_gains_t *gains, int32_t emf_v_q25,
                      int32_t resistive_v_q25, int32_t margin_q17);

// Move the trim after the step: `binding` tells whether the bound was the active limit.
void limiter_update(limiter_t *limiter, const limiter_gains_t *gains, int32_t resistive_v_q25, int32_t margin_q17,
                    bool binding);

#endif
