// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Faults by name (faults.toml), and the log of the last ones.
#ifndef FL_FAULTS_H
#define FL_FAULTS_H

#include <stdint.h>

#include "names.h"

#define FAULT_LOG_LENGTH 8u

typedef struct {
  fault_t fault;
  uint32_t tick;
} fault_entry_t;

typedef struct {
  fault_entry_t entry[FAULT_LOG_LENGTH];
  uint32_t count;  // since boot, with what the drive rode through; entry (count - 1) % length is the newest
} fault_log_t;

// Name of a fault, as the console prints it.
const char *fault_name(fault_t fault);

// The fault that a set of trip causes means; the most dangerous one where several came in the same clock.
fault_t fault_of_trip(uint32_t causes);

// The fault that a deadline trip means; monitor: MONITOR_*, 0: the leg carriers.
fault_t fault_of_monitor(uint32_t monitor);

void fault_log_add(fault_log_t *log, fault_t fault, uint32_t tick);

#endif
