// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/angle_sequence.h"

#include "control/placement.h"

SMALL_CODE_BEGIN

HOT angle_sequence_leads_t angle_sequence_leads(angle_sequence_t sequence, const vector_machine_t *machine,
                                                int32_t speed_turn_q36) {
  const int32_t action_q32 = vector_action_turn_q32(machine, speed_turn_q36);
  const int32_t held_q32 = action_q32 - vector_turn_q32(machine, speed_turn_q36) / 2;
  switch (sequence) {
    case SEQUENCE_HELD:
      return (angle_sequence_leads_t){held_q32, held_q32};
    case SEQUENCE_HALF_STEP:
      return (angle_sequence_leads_t){action_q32, action_q32};
    case SEQUENCE_EXACT:
      return (angle_sequence_leads_t){action_q32, 0};
    case SEQUENCE_HELD_TIAN:
    default:
      return (angle_sequence_leads_t){0, 0};
  }
}

SMALL_CODE_END
