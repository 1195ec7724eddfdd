// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/handover.h"

#include "control/fixed.h"

static uint16_t add_count(uint16_t count, uint16_t more) {
  const uint32_t sum = (uint32_t)count + more;
  return (sum > UINT16_MAX) ? UINT16_MAX : (uint16_t)sum;
}

void handover_reset(handover_t *handover, uint16_t crossings, uint8_t late) {
  handover->crossings = crossings;
  handover->late = late;
  handover->clean = 0;
  handover->plausible = 0;
}

void handover_step(handover_t *handover, uint16_t crossings, uint8_t late, uint32_t interval_cycles,
                   uint32_t forced_cycles, uint32_t tolerance_q16) {
  const uint16_t fresh = (uint16_t)(crossings - handover->crossings);
  if (fresh == 0u) {
    return;
  }
  const bool is_late = late != handover->late;
  handover->crossings = crossings;
  handover->late = late;
  const uint32_t distance =
      (interval_cycles > forced_cycles) ? interval_cycles - forced_cycles : forced_cycles - interval_cycles;
  const bool agrees = ((uint64_t)distance << 16) <= (uint64_t)forced_cycles * tolerance_q16;
  handover->plausible = agrees ? add_count(handover->plausible, fresh) : 0u;
  handover->clean = (agrees && !is_late) ? add_count(handover->clean, fresh) : 0u;
}
