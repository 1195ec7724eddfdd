// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/emf_shape.h"

#include <stdbool.h>

#include "control/fixed.h"
#include "control/placement.h"

#define PERIODS 6u    // a turn
#define PART_BITS 28  // of half a turn's 31
#define REST_BITS 7
#define ROOM_MAX_V_Q25 (1 << 25)

HOT void emf_shape_follow(emf_shape_t *shape, const emf_shape_settings_t *settings, int32_t emf_v_q25,
                          int32_t speed_turn_q36, int32_t room_v_q25, int32_t tick_cycles) {
  const int32_t size_turn_q36 = abs_sat(speed_turn_q36);
  const int32_t room = (size_turn_q36 < settings->most_turn_q36) ? room_v_q25 : 0;
  shape->emf_v_q25 = within_i32(emf_v_q25, clamp_i32(room, 0, ROOM_MAX_V_Q25) * 8);
  // What acts for two ticks has its middle half a tick later.
  const bool slow = size_turn_q36 < settings->most_turn_q36 / 2;
  const int32_t lead_cycles = settings->lead_cycles + (slow ? tick_cycles / 2 : 0);
  shape->rests_mask = slow ? 1u : 0u;
  shape->lead_turn_q32 = (uint32_t)(((int64_t)speed_turn_q36 * lead_cycles) >> 4);
}

static inline int32_t between(const int32_t *table, int32_t rest) {
  return table[0] + (((table[1] - table[0]) * rest) >> REST_BITS);
}

HOT complex_t emf_shape_q24(const emf_shape_t *shape, const emf_shape_settings_t *settings, uint32_t angle_turn_q32) {
  const int32_t turn_q32 = (int32_t)(PERIODS * (angle_turn_q32 + shape->lead_turn_q32));
  const uint32_t half_q31 = (uint32_t)abs_sat(turn_q32);
  const uint32_t part = half_q31 >> PART_BITS;
  const int32_t rest = (int32_t)((half_q31 >> (PART_BITS - REST_BITS)) & ((1u << REST_BITS) - 1u));
  const int32_t d_q24 = between(settings->d_q24 + part, rest);
  return (complex_t){(turn_q32 < 0) ? -d_q24 : d_q24, between(settings->q_q24 + part, rest)};
}
