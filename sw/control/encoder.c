// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/encoder.h"

#include "control/placement.h"

#define ONE_Q30 ((int32_t)1 << 30)
#define HALF_PI_Q30 1686629713

HOT uint32_t encoder_turn_q32(const encoder_settings_t *settings, uint32_t position, int32_t speed_turn_q36) {
  const uint64_t turns = (uint64_t)(2u * position + 1u) * (uint32_t)settings->turn.mant;
  const int64_t travel_q36 = (int64_t)speed_turn_q36 * (int32_t)settings->latency_cycles;
  return (uint32_t)(turns >> settings->turn.shift) + (uint32_t)(travel_q36 >> 4);
}

HOT int32_t encoder_error_q30(uint32_t encoder_turn_q32, uint32_t estimated_turn_q32) {
  const int32_t ahead_q32 = (int32_t)(encoder_turn_q32 - estimated_turn_q32);
  return (int32_t)(((int64_t)clamp_i32(ahead_q32, -ONE_Q30 / 2, ONE_Q30 / 2) * HALF_PI_Q30) >> 30);
}

COLD void encoder_swing_begin(encoder_swing_t *swing, uint32_t turn_q32) {
  *swing = (encoder_swing_t){.first_turn_q32 = turn_q32};
}

COLD void encoder_swing_step(encoder_swing_t *swing, uint32_t turn_q32) {
  const int32_t ahead_q32 = (int32_t)(turn_q32 - swing->first_turn_q32);
  swing->lowest_turn_q32 = (ahead_q32 < swing->lowest_turn_q32) ? ahead_q32 : swing->lowest_turn_q32;
  swing->highest_turn_q32 = (ahead_q32 > swing->highest_turn_q32) ? ahead_q32 : swing->highest_turn_q32;
}

COLD uint32_t encoder_swing_middle_q32(const encoder_swing_t *swing) {
  return swing->first_turn_q32 + (uint32_t)(swing->lowest_turn_q32 / 2 + swing->highest_turn_q32 / 2);
}
