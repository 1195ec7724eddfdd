// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/carrier.h"

#include "control/fixed.h"
#include "control/placement.h"

#define DUTY_ONE_Q30 ((int32_t)1 << 30)
#define PULSE_MAX_Q8 0xFFFFFFu

HOT int32_t duty_from_voltage_q30(int32_t u_v_q25, int32_t vdc_v_q25, int32_t diode_v_q25) {
  const int32_t above = u_v_q25 + diode_v_q25;
  // The measured voltage has 17 bits; with them the quotient comes in two divisions of 8 and 14 bits.
  const uint32_t full_q17 = (uint32_t)(vdc_v_q25 + diode_v_q25 + 128) >> 8;
  if (above <= 0 || full_q17 == 0u) {
    return 0;
  }
  const uint32_t whole_q8 = (uint32_t)above / full_q17;
  if (whole_q8 >= 256u) {
    return DUTY_ONE_Q30;
  }
  const uint32_t rest = (uint32_t)above - whole_q8 * full_q17;
  const uint32_t fraction_q14 = (rest << 14) / full_q17;
  return (int32_t)((whole_q8 << 22) + (fraction_q14 << 8));
}

HOT int32_t voltage_from_duty_v_q25(int32_t duty_q30, int32_t vdc_v_q25, int32_t diode_v_q25) {
  const gain_t duty = {.mant = duty_q30, .shift = 30};
  return gain_apply(vdc_v_q25 + diode_v_q25, duty) - diode_v_q25;
}

HOT uint32_t carrier_period_cycles(int32_t duty_q30, uint32_t period_cycles, uint32_t longest_cycles,
                               uint32_t on_time_floor_cycles) {
  if (duty_q30 <= 0) {
    return longest_cycles;
  }
  const uint64_t floor_q30 = (uint64_t)on_time_floor_cycles << 30;
  const uint32_t duty = (uint32_t)duty_q30;
  if ((uint64_t)period_cycles * duty >= floor_q30) {
    return period_cycles;
  }
  if ((uint64_t)longest_cycles * duty <= floor_q30 || duty >> 14 == 0u) {
    return longest_cycles;
  }
  // One hardware division: as many bits as 32 hold are enough for whole clocks.
  const uint32_t bits = (on_time_floor_cycles < 16384u) ? 18u : 16u;
  return clamp_u32((on_time_floor_cycles << bits) / (duty >> (30u - bits)), period_cycles, longest_cycles);
}

HOT uint32_t pulse_cycles_q8(int32_t duty_q30, uint32_t period_cycles, int32_t added_cycles_q8) {
  if (duty_q30 <= 0) {
    return 0;
  }
  const int64_t width = (int64_t)(((uint64_t)(uint32_t)duty_q30 * period_cycles) >> 22) + added_cycles_q8;
  if (width <= 0) {
    return 0;
  }
  return (width > (int64_t)PULSE_MAX_Q8) ? PULSE_MAX_Q8 : (uint32_t)width;
}
