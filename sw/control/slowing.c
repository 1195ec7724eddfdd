// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/slowing.h"

#include "control/fixed.h"
#include "control/placement.h"

#define FOLLOWING_SHIFT 6
#define LOWER_SHIFT 11
#define FASTER_SHIFT 4
#define MEAN_SHIFT 3

COLD void slowing_begin(slowing_t *slowing, int32_t speed_rpm_q8) {
  const int32_t speed = abs_sat(speed_rpm_q8);
  *slowing = (slowing_t){.first_rpm_q8 = speed, .mean_rpm_q8 = speed, .lowest_rpm_q8 = speed};
}

COLD slowing_verdict_t slowing_step(slowing_t *slowing, int32_t speed_rpm_q8, int32_t demand_rpm_q8, uint32_t ticks,
                                    uint32_t patience_ticks) {
  const int32_t speed = abs_sat(speed_rpm_q8);
  const bool follows = speed - abs_sat(demand_rpm_q8) <= speed >> FOLLOWING_SHIFT;
  slowing->mean_rpm_q8 += (speed - slowing->mean_rpm_q8) >> MEAN_SHIFT;
  if (follows || slowing->mean_rpm_q8 < slowing->lowest_rpm_q8 - (slowing->lowest_rpm_q8 >> LOWER_SHIFT)) {
    slowing->lowest_rpm_q8 = slowing->mean_rpm_q8;
    slowing->ticks = 0;
    return SLOWING_YES;
  }
  slowing->ticks += ticks;
  if (slowing->ticks < patience_ticks) {
    return SLOWING_YES;
  }
  return (speed > slowing->first_rpm_q8 + (slowing->first_rpm_q8 >> FASTER_SHIFT)) ? SLOWING_FASTER : SLOWING_NO;
}
