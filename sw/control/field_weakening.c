// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/field_weakening.h"

#include "control/placement.h"
#include "control/trig.h"

#define FRACTION_BITS 5

HOT int32_t field_weakening_step(field_weakening_t *state, const field_weakening_settings_t *settings,
                                 complex_t voltage_v_q25, int32_t highest_i_q25) {
  const int32_t margin = settings->wanted_v_q25 - (int32_t)complex_abs(voltage_v_q25);
  const int32_t change = gain_apply(margin, settings->ki);
  const int32_t next = clamp_i32(state->current_i_q30 + change, settings->lowest_i_q25 * (1 << FRACTION_BITS),
                                 highest_i_q25 * (1 << FRACTION_BITS));
  state->current_i_q30 = next;
  return next >> FRACTION_BITS;
}
