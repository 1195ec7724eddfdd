// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/limiter.h"

#include "control/placement.h"

#define DECAY_SHIFT 6

HOT int32_t limiter_bound(const limiter_t *limiter, const limiter_gains_t *gains, int32_t emf_v_q25,
                          int32_t resistive_v_q25, int32_t margin_q17) {
  return emf_v_q25 + resistive_v_q25 + gain_apply(margin_q17, gains->kp) + limiter->trim_v_q25;
}

HOT void limiter_update(limiter_t *limiter, const limiter_gains_t *gains, int32_t resistive_v_q25,
                        int32_t margin_q17, bool binding) {
  if (!binding) {
    limiter->trim_v_q25 -= limiter->trim_v_q25 / (1 << DECAY_SHIFT);
    return;
  }
  const int32_t rail = resistive_v_q25 / 2;
  limiter->trim_v_q25 = clamp_i32(limiter->trim_v_q25 + gain_apply(margin_q17, gains->ki), -rail, rail);
}
