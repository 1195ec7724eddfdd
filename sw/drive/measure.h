// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// From the snapshot to the measured quantities of the drive.
#ifndef FL_MEASURE_H
#define FL_MEASURE_H

#include "drive/drive.h"

// Crossings after which the electrical period consists of real intervals.
#define CROSSINGS_FOR_SPEED 7u

// Once a tick, before everything else. About 350 clocks, 150 more when a crossing came.
void measure_update(drive_t *drive, const chip_snapshot_t *in);

#endif
