// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Angles of the injection: what inverse Park and the reported angle have beyond the angle of Park, at any delay T_d from
// the sample to the update of its voltage.
//
//   action = omega (T_d + T_s/2), to the middle of the voltage's effect; delta = omega T_s
//   sequence          inverse Park      reported          T_d = T_s
//   held as in Tian   0                 0                 0, 0
//   held as in Yu     action - delta/2  action - delta/2  1, 1 delta
//   half-step         action            action            1.5, 1.5
//   exact             action            0                 1.5, 0
//
// Source: Yu 2022, generalised in T_d; errors at rest: docs/theory/five-phase.md.
#ifndef FL_ANGLE_SEQUENCE_H
#define FL_ANGLE_SEQUENCE_H

#include <stdint.h>

#include "control/vector_model.h"

typedef enum { SEQUENCE_HELD_TIAN, SEQUENCE_HELD, SEQUENCE_HALF_STEP, SEQUENCE_EXACT } angle_sequence_t;

typedef struct {
  int32_t lead_q32;    // of inverse Park, 2^32 = one turn
  int32_t report_q32;  // of the reported angle
} angle_sequence_leads_t;

// At a signed electrical speed; the machine's delay and period count. About 100 clocks.
angle_sequence_leads_t angle_sequence_leads(angle_sequence_t sequence, const vector_machine_t *machine,
                                            int32_t speed_turn_q36);

#endif
