// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/line_current.h"

#include "control/fixed.h"
#include "control/placement.h"

HOT int32_t line_current_ratio_q16(int32_t vdc_v_q25, int32_t emf_v_q25, int32_t resistive_v_q25, int32_t diode_v_q25,
                                   int32_t duty_q30) {
  const gain_t off = {.mant = (1 << 30) - duty_q30, .shift = 30};
  const int32_t behind = emf_v_q25 + resistive_v_q25 + gain_apply(diode_v_q25, off);
  if (vdc_v_q25 <= 0) {
    return 0;
  }
  if (behind <= vdc_v_q25 / (LINE_CURRENT_RATIO_MAX_Q16 >> 16) || behind < 512) {
    return LINE_CURRENT_RATIO_MAX_Q16;
  }
  // The measured voltage has 17 bits: 16 of them fill the numerator of one hardware division.
  const uint32_t vdc_q16 = clamp_u32((uint32_t)vdc_v_q25 >> 9, 0, 65535);
  return (int32_t)((vdc_q16 << 16) / ((uint32_t)behind >> 9));
}

HOT int32_t line_current(int32_t idc, int32_t ratio_q16) { return mul_q16(idc, ratio_q16); }

HOT int32_t line_current_limit_q25(int32_t dc_limit_q17, int32_t ratio_q16) {
  const int64_t limit_q17 = ((int64_t)dc_limit_q17 * ratio_q16) >> 16;
  return (limit_q17 >= FULL_Q17) ? 1 << 25 : (int32_t)limit_q17 * 256;
}
