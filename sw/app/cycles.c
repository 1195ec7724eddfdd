// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "app/cycles.h"

#include "control/fixed.h"

void cycles_reset(cycles_t *cycles) { *cycles = (cycles_t){.min = UINT32_MAX}; }

uint32_t cycles_mean(const cycles_t *cycles) {
  if (cycles->count == 0u) {
    return 0;
  }
  return div_sat_u32(((uint64_t)cycles->sum_high << 32) | cycles->sum_low, cycles->count);
}
