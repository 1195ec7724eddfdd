// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Mechanical speed from the electrical period that the commutation timer measures.
//
//   n = 60 * f_clk / (pole_pairs * period)   in r/min
#ifndef FL_SPEED_H
#define FL_SPEED_H

#include <stdint.h>

// 60 * f_clk * 256 / pole_pairs: divided by a period in clocks it gives the speed in r/min Q8.
uint64_t speed_numerator_q8(uint32_t clock_hz, uint32_t pole_pairs);

// Speed for a period of one electrical turn, saturates at INT32_MAX (period 0 too). About 140 clocks.
int32_t speed_from_period_rpm_q8(uint64_t numerator_q8, uint32_t period_cycles);

#endif
