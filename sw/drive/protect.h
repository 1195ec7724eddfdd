// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Slow protection: what the hardware's trips do not see, because it needs a model, a memory or patience.
//
//   overload         I²t of the machine's current
//   current_sum      phase currents that do not add up to zero, as with one that is stuck
//   stuck_channel    the mean of DC current or vdc over a tick keeps its value
//   command_timeout  a console that has been silent for longer than it promised
#ifndef FL_PROTECT_H
#define FL_PROTECT_H

#include "drive/drive.h"

// One look at a snapshot with sums and phase currents; current_i_q17: of the machine, magnitude; ticks: since the look
// before. True: the drive has entered a fault. In every state but init and fault. About 150 clocks.
bool protect_step(drive_t *drive, const chip_snapshot_t *in, int32_t current_i_q17, uint32_t ticks);

#endif
