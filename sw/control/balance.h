// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Adaptive crossing thresholds (Yang 2020, ch. 3): divider-gain errors and unequal inductances shift the crossings of a
// phase's two sectors; the six crossing intervals show it, the thresholds are moved until they are equal.
//
//   delta[s] = delta[s-1] + t[s] - t_turn/6, mean 0    how late the crossing in sector index s comes, clocks
//   e[s] = +-delta[s]                                  so far its threshold stands too high: late where the voltage rises
//   V = (e[s] + e[s+3]) / 2    of the phase that floats in s and s + 3, same sign in both: divider gain
//   H = (e[s] - e[s+3]) / 2    opposite sign, s of odd index: inductances; sum over the phases 0
//   u_V -= k V,  u_H -= k H,   threshold[s] = base + u_V + u_H (s odd), base + u_V - u_H (s even)
//   k = w T_turn * (2 pi / T_turn) * dv/dtheta         v in fractions of vdc
//
// V and H are the thesis's eps_V and eps_H in clocks: for phase B, V = (theta_25 - theta_52)/4. A lag common to all six
// sectors does not show and stays. No parameter of machine or dividers enters but the slope of the voltage at the
// crossing, which only scales the bandwidth w.
#ifndef FL_BALANCE_H
#define FL_BALANCE_H

#include <stdbool.h>
#include <stdint.h>

#include "control/fixed.h"
#include "settings_table.h"  // BALANCE_NONE..

#define SECTORS 6u

// Integrators by phase A, B, C, in fractions of vdc, Q0.25: common-mode and differential threshold.
typedef struct {
  int32_t vertical_q25[3];
  int32_t horizontal_q25[3];
} balance_t;

// How late the events that ended the intervals of sector index 0..5 came, mean 0; in clocks, six times too large (no
// division). backward: the sectors follow each other downward. Intervals below 2^24. About 150 clocks.
void interval_lateness(const uint32_t interval_cycles[SECTORS], bool backward, int32_t late_x6[SECTORS]);

// By how much the thresholds stand too high, from the intervals that ended in sector index 0..5; as
// interval_lateness.
void balance_errors(const uint32_t interval_cycles[SECTORS], bool backward, int32_t error_x6[SECTORS]);

// Move the integrators by one turn's errors; step: clocks times 6 -> Q0.25 of vdc, bandwidth and slope in it.
// limit_q25: largest magnitude of either part. Parts that the mode excludes return to zero. About 500 clocks.
void balance_step(balance_t *balance, uint32_t mode, const int32_t error_x6[SECTORS], gain_t step,
                  int32_t limit_q25);

// Threshold of sector index 0..5, Q0.17 of vdc, about its value without correction.
int32_t balance_threshold_q17(const balance_t *balance, uint32_t sector, int32_t base_q17);

#endif
