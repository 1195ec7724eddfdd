// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/handover.h"

#include "control/placement.h"

SMALL_CODE_BEGIN
void handover_reset(handover_t *handover, uint16_t crossings) {
  handover->crossings = crossings;
  handover->seen = false;
}

bool handover_step(handover_t *handover, uint16_t crossings, uint32_t commutations, uint32_t interval_cycles,
                   uint32_t least_cycles, uint32_t most_cycles) {
  const uint16_t fresh = (uint16_t)(crossings - handover->crossings);
  if (fresh == 0u) {
    return false;
  }
  const bool follows = fresh > 1u || (handover->seen && commutations == handover->commutation + 1u);
  handover->crossings = crossings;
  handover->seen = true;
  handover->commutation = commutations;
  return follows && interval_cycles >= least_cycles && interval_cycles <= most_cycles;
}
SMALL_CODE_END
