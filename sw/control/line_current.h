// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Current of the conducting pair from the mean DC-link current, by the balance of power:
//
//   idc * vdc = i * (emf + R*i + (1 - duty) * V_D)       ratio = vdc / (emf + R*i + (1 - duty) * V_D),  i = ratio * idc
//
// The commutation drop is absent: what the outgoing phase's inductance held returns to the link. The same holds with
// discontinuous current, where duty and current are not proportional. i in the bracket is the last result.
#ifndef FL_LINE_CURRENT_H
#define FL_LINE_CURRENT_H

#include <stdint.h>

#define LINE_CURRENT_RATIO_MAX_Q16 (32 << 16)

// Ratio for this operating point, at most LINE_CURRENT_RATIO_MAX_Q16 (near standstill nothing is left to divide by).
// Voltages within +-PRODUCT_MAX, 0 <= duty <= 1. About 130 clocks.
int32_t line_current_ratio_q16(int32_t vdc_v_q25, int32_t emf_v_q25, int32_t resistive_v_q25, int32_t diode_v_q25,
                               int32_t duty_q30);

// Current for a DC-link current of at most full scale. About 25 clocks.
int32_t line_current(int32_t idc, int32_t ratio_q16);

// The current at which the DC-link current reaches its limit, at most full scale.
int32_t line_current_limit_q25(int32_t dc_limit_q17, int32_t ratio_q16);

#endif
