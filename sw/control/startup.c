// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/startup.h"

#include "control/fixed.h"
#include "control/placement.h"

// Longer ramps go on with the interval of this commutation.
#define COMMUTATION_MAX 32000u

SMALL_CODE_BEGIN
uint32_t start_sector(uint32_t leg, bool reverse) {
  // Forward: 330 + 60 k = 120 leg + 90, so k = 2 leg + 2. Reverse: 330 + 60 k = 120 leg - 90, so k = 2 leg + 5.
  return (2u * leg + (reverse ? 5u : 2u)) % 6u;
}

// sqrt(odd) in Q10, odd < 2^16: ten bits below the point while they fit, eight above.
static uint32_t root_q10(uint32_t odd) {
  return (odd < 4096u) ? sqrt_u32(odd << 20) : sqrt_u32(odd << 16) << 2;
}

uint32_t forced_interval_cycles(uint32_t first_cycles, uint32_t commutation) {
  const uint32_t odd = 2u * ((commutation < COMMUTATION_MAX) ? commutation : COMMUTATION_MAX) + 1u;
  return div_sat_u32((uint64_t)first_cycles << 11, root_q10(odd) + root_q10(odd + 2u));
}

SMALL_CODE_END
