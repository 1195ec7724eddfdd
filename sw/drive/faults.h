// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Faults by name, and the log of the last ones.
#ifndef FL_FAULTS_H
#define FL_FAULTS_H

#include <stdint.h>

typedef enum {
  FAULT_NONE = 0,
  FAULT_PARAMETER_MAGIC,
  FAULT_PARAMETER_VERSION,
  FAULT_PARAMETER_CRC,
  FAULT_PARAMETER_RANGE,
  FAULT_CHIP,
  FAULT_NO_SAMPLES,
  FAULT_CURRENT_OFFSET,
  FAULT_PHASE_OVER_CURRENT,
  FAULT_DC_OVER_CURRENT,
  FAULT_FAULT_PIN,
  FAULT_OVER_VOLTAGE,
  FAULT_UNDER_VOLTAGE,
  FAULT_SOFTWARE_TRIP,
  FAULT_LOST_LOCK,
  FAULT_START_FAILED,
  FAULT_ROTOR_SPINNING,
  FAULT_OVERSPEED,
  FAULT_HALL_SENSOR,
  FAULT_VOLTAGE_CHANNEL,
  FAULT_DEADLINE,
  FAULT_POLARITY_UNSURE,
  FAULT_INJECTION_SIGNAL,
  FAULT_INJECTION_NOISE,
  FAULT_NO_SALIENCY,
  FAULT_WATCHDOG,
  FAULT_SETTINGS_CHANGED,
  FAULT_OVERLOAD,
  FAULT_CURRENT_SUM,
  FAULT_STUCK_CHANNEL,
  FAULT_COMMAND_TIMEOUT,
  FAULT_OPEN_PHASE,
  FAULT_OPEN_PHASES,
  FAULT_BRAKE_OVERLOAD,
  FAULT_CONVERTER,
  FAULT_COUNT,
} fault_t;

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
