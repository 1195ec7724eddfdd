// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Correction B at work: reads the sectors' intervals once a turn, moves the thresholds, one stage a tick.
//
// Nothing moves while the speed changes by more than 1/128 from turn to turn, after a late or missed crossing (the time
// of a late one says when it became visible, not when it was), and while the drive is frozen.
#ifndef FL_THRESHOLDS_H
#define FL_THRESHOLDS_H

#include "drive/drive.h"

// Thresholds of the parameters, nothing learnt.
void thresholds_reset(drive_t *drive);

// One step while running. About 30 clocks while nothing is due, at most 700.
void thresholds_step(drive_t *drive, const chip_snapshot_t *in);

#endif
