// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/brake.h"

#include "control/placement.h"

#define ONE_Q16 65536
#define RISE_SHIFT 6

HOT int32_t brake_current(int32_t last_i, int32_t limit_i, int32_t vdc_v_q25, int32_t full_v_q25,
                          gain_t one_over_range) {
  const int32_t share_q16 = clamp_i32(gain_apply(full_v_q25 - vdc_v_q25, one_over_range), 0, ONE_Q16);
  const int32_t allowed = mul_q16(limit_i, share_q16);
  const int32_t risen = last_i + (limit_i >> RISE_SHIFT) + 1;
  return (allowed < risen) ? allowed : risen;
}
