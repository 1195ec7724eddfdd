// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Is the injection's angle to be trusted? From the amplitudes of each result:
//
//   A      mean of I_d
//   noise  of the angle (rad): scatter / 2.257 L_q / (L_q - L_d) / A, scatter the mean of |dI_d| + |dI_q| from result to
//          result, which is 4 sigma / sqrt(pi) for white noise of sigma an axis
//   ratio  of the inductances as it is seen: L_q / L_d A / A_expected. Beside the d axis, or where saturation takes the
//          saliency, it goes to 1
//
// Between a value from which the current is derated and one that is a fault the permitted share of the current falls
// evenly to 0. A fault that lasts has a name: a good result takes back one bad one.
#ifndef FL_INJECTION_VALIDITY_H
#define FL_INJECTION_VALIDITY_H

#include <stdint.h>

#include "control/complex_fixed.h"

typedef enum {
  INJECTION_GOOD,
  INJECTION_DERATED,
  INJECTION_NO_SIGNAL,    // I_d below its least value
  INJECTION_NOISE,
  INJECTION_NO_SALIENCY,
} injection_verdict_t;

typedef struct {
  int32_t minimum_i_q21;      // least A
  int32_t expected_i_q21;     // A of the motor file's L_d, > 0
  uint32_t saliency_q16;      // L_q / L_d of the motor file
  uint32_t derate_ratio_q16;  // above fault_ratio_q16
  uint32_t fault_ratio_q16;
  uint32_t noise_factor_q16;  // L_q / (L_q - L_d) / 2.257
  uint32_t derate_noise_q16;  // rad
  uint32_t fault_noise_q16;   // above derate_noise_q16
  int32_t filter_shift;       // averages over 2^shift results
  uint32_t fault_results;     // more bad than good ones, for a fault
} injection_validity_settings_t;

typedef struct {
  int64_t mean_i_q37;     // A and scatter with 16 bits more
  int64_t scatter_i_q37;
  complex_t last_i_q21;
  uint32_t seen;          // results, saturates at what the filters need
  uint32_t bad;           // bad results less good ones, from 0
  uint32_t noise_q16;     // of the last result, rad
  uint32_t ratio_q16;
  uint32_t share_q16;     // of the current that is permitted
  injection_verdict_t verdict;  // a fault stays until the next begin
} injection_validity_t;

void injection_validity_begin(injection_validity_t *state);

// One result, injection_vector_i_q21. Judged from 2^(shift + 1) results on. About 450 clocks.
void injection_validity_step(injection_validity_t *state, const injection_validity_settings_t *settings,
                             complex_t vector_i_q21);

const char *injection_verdict_name(injection_verdict_t verdict);

#endif
