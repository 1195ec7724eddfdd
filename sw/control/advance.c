// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/advance.h"

#include "control/fixed.h"
#include "control/placement.h"

int32_t advance_added_q16(int32_t at_speed_q16, int32_t speed_ratio_q16, int32_t at_current_q16,
                          int32_t current_ratio_q16) {
  return mul_q16(at_speed_q16, speed_ratio_q16) + mul_q16(at_current_q16, current_ratio_q16);
}

HOT int32_t advance_total_q16(int32_t base_q16, int32_t added_q16) {
  return clamp_i32(base_q16 + added_q16, -ADVANCE_MAX_Q16, ADVANCE_MAX_Q16);
}
