// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/lost_angle.h"

#include "control/placement.h"

#define ERROR_Q30 (ONE_Q30 / 2)
#define POWER_Q8 196u  // 0.765
#define BLIND_Q8 115u  // 0.45
// Products of a voltage and a current are upper halves, of the current in q27: four full scales.
#define CURRENT_BITS 10
#define PRODUCT_BITS 2  // of q25 with q25
#define WHOLE 4u

// Length within 7 per cent.
static inline uint32_t rough_i_q25(complex_t i_q17) {
  const uint32_t a = (uint32_t)abs_sat(i_q17.re);
  const uint32_t b = (uint32_t)abs_sat(i_q17.im);
  return ((a > b) ? a + (b >> 1) - (b >> 3) : b + (a >> 1) - (a >> 3)) << 8;
}

static inline int32_t product(uint32_t v_q25, uint32_t i_q25) {
  return mul_high_i32((int32_t)v_q25, (int32_t)(i_q25 << PRODUCT_BITS));
}

INLINED angle_verdict_t lost_angle_step(uint32_t *count, const lost_angle_settings_t *settings,
                                        const lost_angle_input_t *in) {
  const complex_t i_q27 = {in->current_i_q17.re * (1 << CURRENT_BITS), in->current_i_q17.im * (1 << CURRENT_BITS)};
  const uint32_t length_i_q25 = rough_i_q25(in->current_i_q17);
  const uint32_t wrong_v_q25 =
      (uint32_t)gain_apply((int32_t)length_i_q25, settings->resistance) + settings->floor_v_q25;
  const int32_t power = mul_high_i32(in->emf_v_q25.re, i_q27.re) + mul_high_i32(in->emf_v_q25.im, i_q27.im);
  const bool braking = (in->current_i_q17.im < 0) != in->backward;
  const uint32_t torque_i_q25 = (uint32_t)abs_sat(in->current_i_q17.im) << 8;
  const int32_t due = product((in->expected_v_q25 >> 8) * POWER_Q8, torque_i_q25) - product(wrong_v_q25, length_i_q25);
  const bool powerless = length_i_q25 > settings->current_i_q25 && (braking ? -power : power) < due;
  const bool amplitude =
      in->amplitude_v_q25 < in->expected_v_q25 / 2u || in->amplitude_v_q25 / 2u > in->expected_v_q25;
  const bool contradicted = amplitude || powerless || abs_sat(in->error_q30) > ERROR_Q30;
  const bool slow = in->speed_turn_q36 < settings->least_turn_q36;
  const bool blind = wrong_v_q25 > (in->expected_v_q25 >> 8) * BLIND_Q8;
  const uint32_t add = (contradicted || slow) ? WHOLE : (blind ? 1u : 0u);
  if (__builtin_expect(add == 0u, 1)) {
    *count = (*count > WHOLE) ? *count - WHOLE : 0u;
    return ANGLE_HELD;
  }
  *count += add;
  if (*count <= settings->most) {
    return ANGLE_HELD;
  }
  *count = 0;
  const bool gone = in->amplitude_v_q25 < in->expected_v_q25 / 8u || in->amplitude_v_q25 < wrong_v_q25;
  if (contradicted && !gone) {
    return ANGLE_CONTRADICTED;
  }
  return (slow && !contradicted && in->speed_turn_q36 < 0) ? ANGLE_OVERHAULED : ANGLE_STALLED;
}
