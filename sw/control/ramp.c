// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/ramp.h"

#include "control/placement.h"

void ramp_preset(ramp_t *ramp, int32_t value_rpm_q8) {
  ramp->value_rpm_q8 = value_rpm_q8;
  ramp->carry_q12 = 0;
}

HOT int32_t ramp_step(ramp_t *ramp, int32_t target_rpm_q8, int32_t step_rpm_q20, int32_t measured_rpm_q8,
                      int32_t window_rpm_q8) {
  const int32_t old = ramp->value_rpm_q8;
  if (target_rpm_q8 == old) {
    return 0;
  }
  // Upward problem: mirror a falling ramp.
  const int32_t direction = (target_rpm_q8 > old) ? 1 : -1;
  const int32_t farthest = direction * measured_rpm_q8 + window_rpm_q8;
  const int32_t start = direction * old;
  const int32_t end = direction * target_rpm_q8;
  const uint32_t step_q20 = (uint32_t)step_rpm_q20 + ramp->carry_q12;
  int32_t next = start + (int32_t)(step_q20 >> 12);
  ramp->carry_q12 = step_q20 & 0xFFFu;
  next = (next > end) ? end : next;
  if (next > farthest) {
    ramp->carry_q12 = 0;
    next = (start > farthest) ? start : farthest;
  }
  ramp->value_rpm_q8 = direction * next;
  return direction;
}
