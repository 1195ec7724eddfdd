#include "control/startup.h"

#include "control/fixed.h"

uint32_t start_sector(uint32_t leg, bool reverse) {
  // Forward: 330 + 60 k = 120 leg + 90, so k = 2 leg + 2. Reverse: 330 + 60 k = 120 leg - 90, so k = 2 leg + 5.
  return (2u * leg + (reverse ? 5u : 2u)) % 6u;
}

uint32_t forced_interval_cycles(uint32_t first_cycles, uint32_t commutation) {
  const uint64_t odd = 2u * (uint64_t)commutation + 1u;
  const uint64_t sum_q16 = (uint64_t)sqrt_u64(odd << 32) + sqrt_u64((odd + 2u) << 32);
  const uint32_t divisor = (sum_q16 > UINT32_MAX) ? UINT32_MAX : (uint32_t)sum_q16;
  return div_sat_u32((uint64_t)first_cycles << 17, divisor);
}
