// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/balance.h"

// Floating phase of a sector: C, B, A, C, B, A.
static uint32_t open_phase(uint32_t sector) { return 2u - sector % 3u; }

void interval_lateness(const uint32_t interval_cycles[SECTORS], bool backward, int32_t late_x6[SECTORS]) {
  int32_t turn = 0;
  for (uint32_t s = 0; s < SECTORS; s++) {
    turn += (int32_t)interval_cycles[s];
  }
  int32_t sum = 0;
  int32_t late = 0;
  for (uint32_t k = 0; k < SECTORS; k++) {
    const uint32_t s = backward ? SECTORS - 1u - k : k;
    late += 6 * (int32_t)interval_cycles[s] - turn;
    late_x6[s] = late;
    sum += late / 6;
  }
  for (uint32_t s = 0; s < SECTORS; s++) {
    late_x6[s] -= sum;
  }
}

void balance_errors(const uint32_t interval_cycles[SECTORS], bool backward, int32_t error_x6[SECTORS]) {
  interval_lateness(interval_cycles, backward, error_x6);
  for (uint32_t s = 0; s < SECTORS; s++) {
    // Forward the floating EMF rises in the sectors of odd index.
    const bool rises = (s % 2u != 0u) != backward;
    error_x6[s] = rises ? error_x6[s] : -error_x6[s];
  }
}

void balance_step(balance_t *balance, uint32_t mode, const int32_t error_x6[SECTORS], gain_t step,
                  int32_t limit_q25) {
  for (uint32_t s = 0; s < 3u; s++) {
    const uint32_t x = open_phase(s);
    // One of s and s + 3 is odd.
    const int32_t even = (s % 2u == 0u) ? error_x6[s] : error_x6[s + 3u];
    const int32_t odd = (s % 2u == 0u) ? error_x6[s + 3u] : error_x6[s];
    const int32_t vertical = gain_apply((odd + even) / 2, step);
    const int32_t horizontal = gain_apply((odd - even) / 2, step);
    balance->vertical_q25[x] =
        (mode == BALANCE_NONE) ? 0 : clamp_i32(balance->vertical_q25[x] - vertical, -limit_q25, limit_q25);
    balance->horizontal_q25[x] =
        (mode != BALANCE_BOTH) ? 0 : clamp_i32(balance->horizontal_q25[x] - horizontal, -limit_q25, limit_q25);
  }
}

int32_t balance_threshold_q17(const balance_t *balance, uint32_t sector, int32_t base_q17) {
  const uint32_t x = open_phase(sector);
  const int32_t horizontal = balance->horizontal_q25[x];
  const int32_t sum = balance->vertical_q25[x] + ((sector % 2u == 0u) ? -horizontal : horizontal);
  return clamp_i32(base_q17 + ((sum + 128) >> 8), 0, SAMPLE_MAX_Q17);
}
