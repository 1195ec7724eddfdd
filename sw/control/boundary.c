// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/boundary.h"

#include "control/carrier.h"
#include "control/placement.h"

#define ONE_Q16 65536

HOT boundary_t boundary(int32_t emf_v_q25, int32_t vdc_v_q25, int32_t diode_v_q25, uint32_t period_cycles,
                        gain_t per_volt) {
  boundary_t b;
  b.duty_q30 = duty_from_voltage_q30(emf_v_q25, vdc_v_q25, diode_v_q25);
  const int32_t above = (vdc_v_q25 > emf_v_q25) ? vdc_v_q25 - emf_v_q25 : 0;
  const int32_t pulse_v_q25 = mul_q16(above, b.duty_q30 >> 14);
  const int32_t carrier_q16 = (int32_t)(period_cycles << (16 - BOUNDARY_CYCLES_SHIFT));
  b.current_i_q25 = sat_i32(((int64_t)gain_apply(pulse_v_q25, per_volt) * carrier_q16) >> 16);
  return b;
}

HOT int32_t boundary_share_q16(const boundary_t *b, int32_t i_q25) {
  const uint32_t magnitude = (uint32_t)abs_sat(i_q25);
  const uint32_t most = (uint32_t)b->current_i_q25;
  if (magnitude >= most) {
    return (i_q25 < 0) ? -ONE_Q16 : ONE_Q16;
  }
  // The quotient is below 1: it fits one hardware division, whose divisor keeps at least 12 bits.
  uint32_t shift = 0;
  while (most >> shift > 0xFFFFu) {
    shift += 4u;
  }
  const int32_t share = (int32_t)((magnitude << (16u - shift)) / (((most - 1u) >> shift) + 1u));
  return (i_q25 < 0) ? -share : share;
}

HOT int32_t discontinuous_duty_q30(const boundary_t *b, int32_t share_q16) {
  const uint32_t square_q32 = (share_q16 >= ONE_Q16) ? UINT32_MAX : (uint32_t)share_q16 << 16;
  return mul_q16(b->duty_q30, (int32_t)sqrt_u32(square_q32));
}
