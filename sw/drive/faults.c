// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "drive/faults.h"

#include "hal/chip_io.h"

const char *fault_name(fault_t fault) {
  static const char *const names[FAULT_COUNT] = {
      [FAULT_NONE] = "none",
      [FAULT_PARAMETER_MAGIC] = "parameter_magic",
      [FAULT_PARAMETER_VERSION] = "parameter_version",
      [FAULT_PARAMETER_CRC] = "parameter_crc",
      [FAULT_PARAMETER_RANGE] = "parameter_range",
      [FAULT_CHIP] = "chip",
      [FAULT_NO_SAMPLES] = "no_samples",
      [FAULT_CURRENT_OFFSET] = "current_offset",
      [FAULT_PHASE_OVER_CURRENT] = "phase_over_current",
      [FAULT_DC_OVER_CURRENT] = "dc_over_current",
      [FAULT_FAULT_PIN] = "fault_pin",
      [FAULT_OVER_VOLTAGE] = "over_voltage",
      [FAULT_UNDER_VOLTAGE] = "under_voltage",
      [FAULT_SOFTWARE_TRIP] = "software_trip",
      [FAULT_LOST_LOCK] = "lost_lock",
      [FAULT_START_FAILED] = "start_failed",
      [FAULT_ROTOR_SPINNING] = "rotor_spinning",
      [FAULT_OVERSPEED] = "overspeed",
      [FAULT_HALL_SENSOR] = "hall_sensor",
      [FAULT_VOLTAGE_CHANNEL] = "voltage_channel",
      [FAULT_DEADLINE] = "deadline",
      [FAULT_POLARITY_UNSURE] = "polarity_unsure",
      [FAULT_INJECTION_SIGNAL] = "injection_signal",
      [FAULT_INJECTION_NOISE] = "injection_noise",
      [FAULT_NO_SALIENCY] = "no_saliency",
      [FAULT_WATCHDOG] = "watchdog",
      [FAULT_SETTINGS_CHANGED] = "settings_changed",
      [FAULT_OVERLOAD] = "overload",
      [FAULT_CURRENT_SUM] = "current_sum",
      [FAULT_STUCK_CHANNEL] = "stuck_channel",
      [FAULT_COMMAND_TIMEOUT] = "command_timeout",
      [FAULT_OPEN_PHASE] = "open_phase",
      [FAULT_OPEN_PHASES] = "open_phases",
      [FAULT_BRAKE_OVERLOAD] = "brake_overload",
      [FAULT_CONVERTER] = "converter",
  };
  return ((uint32_t)fault < FAULT_COUNT) ? names[fault] : "unknown";
}

fault_t fault_of_trip(uint32_t causes) {
  static const struct {
    uint32_t cause;
    fault_t fault;
  } order[] = {
      {TRIP_PHASE_CURRENT, FAULT_PHASE_OVER_CURRENT}, {TRIP_DC_CURRENT, FAULT_DC_OVER_CURRENT},
      {TRIP_FAULT_PIN, FAULT_FAULT_PIN},              {TRIP_OVER_VOLTAGE, FAULT_OVER_VOLTAGE},
      {TRIP_UNDER_VOLTAGE, FAULT_UNDER_VOLTAGE},      {TRIP_SOFTWARE, FAULT_SOFTWARE_TRIP},
      {TRIP_LOST_LOCK, FAULT_LOST_LOCK},              {TRIP_DEADLINE, FAULT_DEADLINE},
  };
  for (uint32_t i = 0; i < sizeof order / sizeof order[0]; i++) {
    if ((causes & order[i].cause) != 0u) {
      return order[i].fault;
    }
  }
  return FAULT_NONE;
}

fault_t fault_of_monitor(uint32_t monitor) {
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
