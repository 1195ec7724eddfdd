// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/csc_linearity.h"

#include "control/fixed.h"
#include "control/placement.h"

#define ONE_Q16 65536u
#define ONE_Q30 ((int32_t)1 << 30)
#define CARRIERS_MAX 255u

HOT csc_linearity_t csc_linearity(uint32_t interval_cycles, uint32_t period_cycles, uint32_t tolerance_q16) {
  // Neutral: M1 = M, always valid.
  csc_linearity_t result = {.first_q16 = ONE_Q16, .second_q16 = ONE_Q16, .rest_q16 = ONE_Q16};
  const uint32_t whole = interval_cycles / period_cycles;
  if (whole > CARRIERS_MAX || period_cycles > 0xFFFFu) {
    return result;
  }
  // The period has 16 bits at most, so one division is enough.
  uint32_t carriers_q16 = (whole << 16) + ((interval_cycles - whole * period_cycles) << 16) / period_cycles;
  const uint32_t count = (carriers_q16 + tolerance_q16) >> 16;
  if ((count << 16) > carriers_q16) {
    carriers_q16 = count << 16;
  }
  result.rest_q16 = carriers_q16 & (ONE_Q16 - 1u);
  result.first_q16 = carriers_q16 / (count + 1u);
  result.second_q16 = (count > 0u) ? carriers_q16 / count : 0u;
  return result;
}

// x_q30 * factor_q16, factor <= 2.
static int32_t times(int32_t x_q30, uint32_t factor_q16) {
  return sat_i32(((int64_t)x_q30 * factor_q16) >> 16);
}

HOT int32_t csc_linear_duty_q30(const csc_linearity_t *linearity, int32_t mean_q30) {
  const int32_t first = times(mean_q30, linearity->first_q16);
  if (first <= (int32_t)(linearity->rest_q16 << 14)) {
    return first;
  }
  if (linearity->second_q16 == 0u) {
    return ONE_Q30;
  }
  return clamp_i32(ONE_Q30 - times(ONE_Q30 - mean_q30, linearity->second_q16), 0, ONE_Q30);
}
