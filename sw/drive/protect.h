// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Slow protection: what the hardware's trips do not see, because it needs a model, a memory or patience.
//
//   overload         I²t of the machine's current
//   current_sum      phase currents that do not add up to zero, as with one that is stuck
//   stuck_channel    the mean of DC current or vdc over a tick keeps its value
//   command_timeout  a console that has been silent for longer than it promised
//   stop_failed      a stop that does not slow the rotor
#ifndef FL_PROTECT_H
#define FL_PROTECT_H

#include "control/overload.h"
#include "control/plausible.h"
#include "control/slowing.h"
#include "drive/method.h"

typedef struct {
  overload_t overload;
  sum_t sum;
  still_t still;
  slowing_t slowing;
  uint32_t crossings;  // at the last look
} protect_t;

// One look at a snapshot with sums and phase currents. ticks: since the look before; silent_ticks: since the console's last
// line. Nothing happens while all is well, and in init and fault. About 170 clocks.
outcome_t protect_step(protect_t *protect, const parameters_t *p, const chip_snapshot_t *in, const order_t *order,
                       const settings_t *settings, const report_t *report, uint32_t ticks, uint32_t silent_ticks);

#endif
