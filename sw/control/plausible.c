// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/plausible.h"

#include "control/fixed.h"

// Half a step of a 12-bit converter from either end of q17.
#define TOP_Q17 (SAMPLE_MAX_Q17 - 80)
#define BAD_LOOK 4u
#define BAD_LIMIT 16u

bool still_step(still_t *still, const int32_t values_q17[], uint32_t channels, uint32_t limit) {
  bool stuck = false;
  for (uint32_t c = 0; c < channels; c++) {
    const int32_t value = values_q17[c];
    const bool inside = value < TOP_Q17 && value > -TOP_Q17;
    const uint16_t low = (uint16_t)((uint32_t)value & 0xFFFFu);
    const uint32_t more = still->same[c] + ((still->same[c] < UINT16_MAX) ? 1u : 0u);
    still->same[c] = (uint16_t)((low == still->last[c] && inside) ? more : 0u);
    still->last[c] = low;
    stuck = stuck || (still->same[c] >= limit && limit > 0u);
  }
  return stuck;
}

bool sum_step(sum_t *sum, int32_t sum_i_q17, int32_t limit_q17) {
  if (limit_q17 > 0 && abs_sat(sum_i_q17) > limit_q17) {
    sum->count += BAD_LOOK;
  } else if (sum->count > 0u) {
    sum->count--;
  }
  return sum->count >= BAD_LIMIT;
}
