// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/stuck.h"

void stuck_reset(stuck_t *stuck) { *stuck = (stuck_t){0}; }

bool stuck_step(stuck_t *stuck, const int32_t v_q17[3], bool emf, uint32_t limit) {
  stuck->quiet_ticks = emf ? 0u : stuck->quiet_ticks + 1u;
  if (stuck->quiet_ticks > limit / 5u) {
    stuck_reset(stuck);
    return false;
  }
  uint32_t count = 0;
  for (uint32_t x = 0; x < 3u; x++) {
    const bool same = v_q17[x] == stuck->last_q17[x];
    stuck->last_q17[x] = v_q17[x];
    stuck->same_ticks[x] = same ? stuck->same_ticks[x] + 1u : 0u;
    count += (stuck->same_ticks[x] >= limit) ? 1u : 0u;
  }
  return count == 1u || count == 2u;
}
