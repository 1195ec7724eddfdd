// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/injection_handover.h"

#include "control/fixed.h"
#include "control/if_start.h"
#include "control/placement.h"

#define WHOLE_Q16 ((int32_t)1 << 16)

SMALL_CODE_BEGIN

void injection_handover_begin(injection_handover_t *state, bool emf) {
  *state = (injection_handover_t){.share_q16 = emf ? WHOLE_Q16 : 0, .emf = emf, .inject = !emf};
}

HOT void injection_handover_step(injection_handover_t *state, const injection_handover_settings_t *settings,
                                 int32_t speed_turn_q36, bool fresh, bool emf_there) {
  const int32_t speed = abs_sat(speed_turn_q36);
  if (!state->inject) {
    state->results = 0;
  } else if (fresh && state->results < settings->results) {
    state->results++;
  }
  if (state->emf && speed < settings->down_turn_q36) {
    state->inject = true;
    state->emf = state->results < settings->results;
  } else if (speed > settings->up_turn_q36) {
    state->emf = state->emf || emf_there;
  }
  state->share_q16 = fade(state->share_q16, state->emf ? WHOLE_Q16 : 0, settings->step_q16);
  if (state->share_q16 == WHOLE_Q16 && speed > settings->up_turn_q36) {
    state->inject = false;
  }
}

HOT int32_t injection_handover_error_q30(const injection_handover_t *state, int32_t injection_q30, int32_t emf_q30) {
  const int64_t sum =
      (int64_t)injection_q30 * (WHOLE_Q16 - state->share_q16) + (int64_t)emf_q30 * state->share_q16;
  return (int32_t)round_shift(sum, 16);
}

int32_t injection_handover_curve_q32(const injection_handover_t *state, int32_t c_q32) {
  return mul_q16(c_q32, WHOLE_Q16 - state->share_q16);
}

SMALL_CODE_END
