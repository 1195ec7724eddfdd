// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Field weakening by the voltage margin: i_d falls while the voltage exceeds what is wanted of it.
//
//   i_d += k_i (u_wanted - |u|),   lowest <= i_d <= highest
//
// u_wanted a few per cent below the circle of the current regulators, so that these keep a reserve; highest is the i_d
// without weakening (0, or that of mtpa.h), lowest what magnet and current limit allow.
#ifndef FL_FIELD_WEAKENING_H
#define FL_FIELD_WEAKENING_H

#include <stdint.h>

#include "control/complex_fixed.h"
#include "control/fixed.h"

typedef struct {
  int32_t current_i_q30;
} field_weakening_t;

typedef struct {
  gain_t ki;             // voltage v_q25 -> current i_q30 a step
  int32_t wanted_v_q25;  // u_wanted
  int32_t lowest_i_q25;  // >= -2^25
} field_weakening_settings_t;

// One step with the voltage of the current regulators; lowest <= highest <= 2^25. Returns i_d, i_q25. About 440 clocks.
int32_t field_weakening_step(field_weakening_t *state, const field_weakening_settings_t *settings,
                             complex_t voltage_v_q25, int32_t highest_i_q25);

#endif
