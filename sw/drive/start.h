// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// The start: wait for a slow rotor, bootstrap precharge, two alignment vectors, forced ramp, hand-over, lock.
#ifndef FL_START_H
#define FL_START_H

#include "drive/drive.h"

// Enter STATE_STARTING at its first phase; direction from the sign of the target.
void start_begin(drive_t *drive);

// One step while starting; leaves the state by itself when the crossings hold the lock.
void start_step(drive_t *drive, const chip_snapshot_t *in);

// This attempt is lost: try again, or FAULT_START_FAILED when the retries are used up.
void start_failed(drive_t *drive);

#endif
