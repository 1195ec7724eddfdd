// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Correction B at work: reads the sectors' intervals once a turn, moves the thresholds, one stage a tick.
//
// Nothing moves while the speed changes by more than 1/128 from turn to turn, after a late or missed crossing (the time
// of a late one says when it became visible, not when it was), and while the drive is frozen.
#ifndef FL_THRESHOLDS_H
#define FL_THRESHOLDS_H

#include "control/balance.h"
#include "drive/six_step/view.h"

typedef struct {
  balance_t balance;
  uint8_t mode;  // BALANCE_NONE.. that the integrators are in
  uint32_t stage;
  bool busy;  // a stage ran in this tick
  uint32_t turn_from;      // crossings when the wait for a turn began
  uint32_t period_cycles;  // of the turn before
  uint8_t late;
  uint8_t timeouts;
  int32_t error_x6[SECTORS];
  gain_t gain;
} thresholds_t;

// Thresholds of the parameters, nothing learnt.
void thresholds_reset(thresholds_t *t, threshold_command_t *command, const parameters_t *p);

// One step while running. source: signal in which crossings are searched for. About 30 clocks while nothing is due, at
// most 700.
void thresholds_step(thresholds_t *t, threshold_command_t *command, const six_step_view_t *view, bool reverse,
                     uint8_t source);

#endif
