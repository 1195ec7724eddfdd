// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/speed.h"

#include "control/fixed.h"
#include "control/placement.h"

uint64_t speed_numerator_q8(uint32_t clock_hz, uint32_t pole_pairs) {
  return div_u64((uint64_t)clock_hz * (60u * 256u), pole_pairs);
}

HOT int32_t speed_from_period_rpm_q8(uint64_t numerator_q8, uint32_t period_cycles) {
  const uint32_t speed = div_sat_u32(numerator_q8, period_cycles);
  return (speed > (uint32_t)INT32_MAX) ? INT32_MAX : (int32_t)speed;
}
