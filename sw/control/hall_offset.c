// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/hall_offset.h"

#include "control/fixed.h"
#include "control/placement.h"

COLD int32_t hall_late_from_intervals_q16(int32_t cycles_x6, uint32_t period_cycles) {
  const uint64_t size_q16 = (uint64_t)(uint32_t)abs_sat(cycles_x6) << 16;
  const int32_t late_q16 = clamp_i32(sat_i32(div_sat_u32(size_q16, period_cycles)), 0, HALL_LATE_MAX_Q16);
  return (cycles_x6 < 0) ? -late_q16 : late_q16;
}

HOT int32_t hall_late_from_phase_q16(uint32_t phase_cycles, uint32_t period_cycles) {
  const uint32_t share_q16 = div_sat_u32(((uint64_t)phase_cycles * 6u) << 16, period_cycles);
  if (share_q16 >= 65536u || share_q16 == 0u) {
    return HALL_LATE_MAX_Q16 + 1;
  }
  return (int32_t)share_q16 - 32768;
}

// Forward the edge into sector p lies between p - 1 and p. Backward it leads from position p to p - 1, where sector
// p + 2 drives negative speed.
COLD void hall_mirror(const int32_t from[SECTORS], bool to_backward, int32_t to[SECTORS]) {
  for (uint32_t p = 0; p < SECTORS; p++) {
    const uint32_t backward = (p + 2u) % SECTORS;
    if (to_backward) {
      to[backward] = -from[p];
    } else {
      to[p] = -from[backward];
    }
  }
}
