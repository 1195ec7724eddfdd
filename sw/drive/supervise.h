// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Judgement of every tick: silent converters, trips, impossible speed, overspeed. It says what has happened and does nothing.
#ifndef FL_SUPERVISE_H
#define FL_SUPERVISE_H

#include "drive/method.h"

typedef struct {
  bool excused;  // an over-current has been taken for a lost lock
} supervise_t;

// Attempts are all that the parameters allow again.
void supervise_renew(supervise_t *supervise);

static inline bool fault_is_over_current(fault_t fault) {
  return fault == FAULT_PHASE_OVER_CURRENT || fault == FAULT_DC_OVER_CURRENT;
}

// Once a tick. explained: the method says that an over-current now is the consequence of a lost lock.
outcome_t supervise_step(supervise_t *supervise, const parameters_t *p, const chip_snapshot_t *in,
                         const order_t *order, const report_t *report, bool explained);

#endif
