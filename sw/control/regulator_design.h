// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Coefficients of the current regulators A, B and C at the actual speed, for complex_regulator.h and the hardware.
//
//   A: complex vector PI     g = k_p + k_i T_s, h = k_p,  k_p = w L, k_i = w (R + j omega L)
//   B: delay left out        g = gamma (1 - t) / Gamma1, at t = T_d/T_s = 1 g = gamma / Gamma2,  h = g Phi
//   C: exact                 g = gamma / (Gamma1 + Gamma2),                                     h = g Phi
//
// g and h are computed to about 28 bits and rounded once, to 18 bits with a common shift; h/g is Phi, with A
// 1 / (1 + (R/L + j omega) T_s), to 18 bits.
#ifndef FL_REGULATOR_DESIGN_H
#define FL_REGULATOR_DESIGN_H

#include <stdbool.h>
#include <stdint.h>

#include "control/complex_regulator.h"
#include "control/vector_model.h"

typedef enum { REGULATOR_A, REGULATOR_B, REGULATOR_C } regulator_order_t;

typedef struct {
  regulator_order_t order;
  int32_t bandwidth_q30;  // A: w T_s, 0..1
  int32_t gamma_q30;      // B, C: 0..1
} regulator_design_t;

// g and h of a model of this machine; the larger of all parts has 17 bits. False, and the gains untouched: they do not
// fit the format. About 1050 clocks: not at every sample.
bool regulator_design(regulator_gains_t *gains, const regulator_design_t *design, const vector_machine_t *machine,
                      const vector_model_t *model);

#endif
