// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Duty for a wanted mean when every commutation restarts the carrier (CSC): the cut last pulse of a sector changes the
// mean (Yang 2020, 5.18). N = N_Z + N_D carriers a sector, N_Z whole ones:
//
//   M1 = N / (N_Z + 1) * M           where M1 <= N_D: the last pulse is whole, its gap is cut
//   M2 = 1 - (N / N_Z) * (1 - M)     else: the last pulse is cut, its gap is missing
//
// Exact, monotonic and continuous in M and N. With N_Z = 0, M1 = N * M is always within N_D. An N just below an integer
// counts as that integer (tolerance): the measured interval jitters.
//
// The carrier's own account of volt-seconds (fl_carrier) owes min(duty, length) clocks to a carrier: it carries over
// fractions of clocks and pulses that the minimum-pulse rule holds back or stretches, never what the cut itself does.
// Both together give the wanted mean; vanishing pulses and gaps need nothing here.
#ifndef FL_CSC_LINEARITY_H
#define FL_CSC_LINEARITY_H

#include <stdint.h>

// For a measured interval: 0.01 carriers.
#define CSC_TOLERANCE_Q16 655u

// The two factors for a number of carriers a sector.
typedef struct {
  uint32_t first_q16;   // N / (N_Z + 1)
  uint32_t second_q16;  // N / N_Z; 0: there is no whole carrier
  uint32_t rest_q16;    // N_D
} csc_linearity_t;

// Factors for sectors of interval_cycles, averaged, and a carrier of period_cycles > 0. tolerance_q16 below 1/4.
// More than 255 carriers a sector need no correction. About 250 clocks.
csc_linearity_t csc_linearity(uint32_t interval_cycles, uint32_t period_cycles, uint32_t tolerance_q16);

// Duty for a wanted mean 0..1. About 60 clocks.
int32_t csc_linear_duty_q30(const csc_linearity_t *linearity, int32_t mean_q30);

#endif
