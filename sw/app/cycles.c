#include "app/cycles.h"

#include "control/fixed.h"
#include "control/placement.h"

void cycles_reset(cycles_t *cycles) { *cycles = (cycles_t){.min = UINT32_MAX}; }

HOT void cycles_add(cycles_t *cycles, uint32_t duration) {
  cycles->min = (duration < cycles->min) ? duration : cycles->min;
  cycles->max = (duration > cycles->max) ? duration : cycles->max;
  cycles->count++;
  const uint64_t sum = (uint64_t)cycles->sum_low + duration;
  cycles->sum_low = (uint32_t)sum;
  cycles->sum_high += (uint32_t)(sum >> 32);
}

uint32_t cycles_mean(const cycles_t *cycles) {
  if (cycles->count == 0u) {
    return 0;
  }
  return div_sat_u32(((uint64_t)cycles->sum_high << 32) | cycles->sum_low, cycles->count);
}
