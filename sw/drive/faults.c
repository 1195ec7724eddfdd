// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "drive/faults.h"

const char *fault_name(fault_t fault) {
  static const char *const names[FAULT_COUNT] = FAULT_WORDS;
  return ((uint32_t)fault < FAULT_COUNT) ? names[fault] : "unknown";
}

fault_t fault_of_trip(uint32_t causes) {
  static const struct {
    uint32_t cause;
    fault_t fault;
  } order[] = FAULT_TRIPS;
  for (uint32_t i = 0; i < sizeof order / sizeof order[0]; i++) {
    if ((causes & order[i].cause) != 0u) {
      return order[i].fault;
    }
  }
  return FAULT_NONE;
}

fault_t fault_of_monitor(uint32_t monitor) {
  if ((monitor & MONITOR_CLOCK) != 0u) {
    return FAULT_CLOCK;
  }
  if ((monitor & MONITOR_CHANGED) != 0u) {
    return FAULT_SETTINGS_CHANGED;
  }
  if ((monitor & MONITOR_LATE) != 0u) {
    return FAULT_NO_SAMPLES;
  }
  if ((monitor & MONITOR_CONVERTER) != 0u) {
    return FAULT_CONVERTER;
  }
  if ((monitor & MONITOR_BRAKE) != 0u) {
    return FAULT_BRAKE_OVERLOAD;
  }
  return ((monitor & (MONITOR_EXPIRED | MONITOR_WRONG)) != 0u) ? FAULT_WATCHDOG : FAULT_DEADLINE;
}

void fault_log_add(fault_log_t *log, fault_t fault, uint32_t tick) {
  fault_entry_t *entry = &log->entry[log->count % FAULT_LOG_LENGTH];
  entry->fault = fault;
  entry->tick = tick;
  log->count++;
}
