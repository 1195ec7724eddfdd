// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Statistics of a handler's duration in clocks.
#ifndef FL_CYCLES_H
#define FL_CYCLES_H

#include <stdint.h>

typedef struct {
  uint32_t min;
  uint32_t max;
  uint32_t count;
  uint32_t sum_low;  // 64-bit sum in two words: the structure is read from outside as plain words
  uint32_t sum_high;
} cycles_t;

void cycles_reset(cycles_t *cycles);
static inline void cycles_add(cycles_t *cycles, uint32_t duration) {
  if (__builtin_expect(duration < cycles->min, 0)) {
    cycles->min = duration;
  }
  if (__builtin_expect(duration > cycles->max, 0)) {
    cycles->max = duration;
  }
  cycles->count++;
  cycles->sum_low += duration;
  if (__builtin_expect(cycles->sum_low < duration, 0)) {
    cycles->sum_high++;
  }
}
// Mean duration, 0 without a call.
uint32_t cycles_mean(const cycles_t *cycles);

#endif
