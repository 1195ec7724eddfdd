// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Boundary of continuous conduction, and the duty below it.
//
// A pulse raises the current of the conducting pair at (vdc - E)/L_l, the gap lets it fall at (E + V_D)/L_l. At the boundary
// it reaches zero just as its carrier ends:
//
//   D_b = (E + V_D) / (vdc + V_D),    I_b = T (vdc - E) D_b / (2 L_l)                 L_l: inductance of two phases
//
// Below, diodes end it before the carrier does, and its mean falls with the square of the duty: D = D_b sqrt(I / I_b).
// With synchronous rectification (V_D = 0) it goes on through zero, and 2 I_b is its ripple, peak to peak.
#ifndef FL_BOUNDARY_H
#define FL_BOUNDARY_H

#include <stdint.h>

#include "control/fixed.h"

#define BOUNDARY_CYCLES_SHIFT 12

typedef struct {
  int32_t duty_q30;
  int32_t current_i_q25;
} boundary_t;

// Boundary for a carrier of period_cycles below 2^16; per_volt: current over voltage of a carrier of 4096 clocks,
// 4096 / (2 L_l f_clk). 0 <= emf. About 200 clocks.
boundary_t boundary(int32_t emf_v_q25, int32_t vdc_v_q25, int32_t diode_v_q25, uint32_t period_cycles, gain_t per_volt);

// Current over that of the boundary, within -1..1. About 60 clocks.
int32_t boundary_share_q16(const boundary_t *b, int32_t i_q25);

// Duty for a share 0..1 of the boundary's current. About 180 clocks.
int32_t discontinuous_duty_q30(const boundary_t *b, int32_t share_q16);

#endif
