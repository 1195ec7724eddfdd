// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Guard, trips and their log, watchdog, brake.
#include "control/placement.h"
#include "hal/blocks.h"
#include "hal/chip.h"
#include "hal/reg.h"

#define CLEAR_KEY 0xA5u
#define LOCK_KEY 0x10CCu
#define ALL_TRIPS 0xFFu

uint32_t safety_polarity(void) {
  const uint32_t guard = reg_read(REG(safety.guard));
  return BITS(FL_SAFETY_REGS__GUARD__HIGH_ACTIVE_LOW, guard) | BITS(FL_SAFETY_REGS__GUARD__LOW_ACTIVE_LOW, guard) << 1;
}

HOT void chip_report_step(uint32_t step) { reg_write(REG(safety.feed), step & 0xFFu); }
void chip_gates_off(void) { reg_write(REG(safety.guard), 0); }

SMALL_CODE_BEGIN
COLD void safety_configure(const parameters_t *p) {
  reg_write(REG(safety.guard), FIELD(FL_SAFETY_REGS__GUARD__SAFE_STATE, p->safe_state));
  reg_write(REG(safety.dead_time), (uint32_t)p->dead_time_cycles);
  reg_write(REG(safety.current_limit), FIELD(FL_SAFETY_REGS__CURRENT_LIMIT__PHASE_LSB, p->trip_phase_lsb) |
                                           FIELD(FL_SAFETY_REGS__CURRENT_LIMIT__DC_LSB, p->trip_dc_lsb));
  reg_write(REG(safety.voltage_limit), FIELD(FL_SAFETY_REGS__VOLTAGE_LIMIT__OVER_LSB, p->trip_over_voltage_lsb) |
                                           FIELD(FL_SAFETY_REGS__VOLTAGE_LIMIT__UNDER_LSB, p->trip_under_voltage_lsb));
  reg_write(REG(safety.trip_enable), ALL_TRIPS);
  reg_write(REG(safety.watchdog), (uint32_t)p->watchdog_cycles);
  reg_write(REG(safety.brake_level), FIELD(FL_SAFETY_REGS__BRAKE_LEVEL__ON_LSB, p->brake_on_lsb) |
                                         FIELD(FL_SAFETY_REGS__BRAKE_LEVEL__OFF_LSB, p->brake_off_lsb));
  reg_write(REG(safety.brake_time), (uint32_t)p->brake_longest_cycles);
  reg_write(REG(safety.sample_age), (uint32_t)p->sample_age_cycles);
  reg_write(REG(safety.brake), FIELD(FL_SAFETY_REGS__BRAKE__ENABLE, p->brake_longest_cycles != 0 ? 1 : 0));
  reg_write(REG(safety.lock), LOCK_KEY);
  reg_write(REG(safety.command), FIELD(FL_SAFETY_REGS__COMMAND__CLEAR_KEY, CLEAR_KEY));
}
SMALL_CODE_END

HOT void safety_read_trips(chip_snapshot_t *snapshot) {
  const uint32_t trip = reg_read(REG(safety.trip));
  snapshot->trip_latched = (uint8_t)BITS(FL_SAFETY_REGS__TRIP__LATCHED, trip);
  snapshot->trip_first = (uint8_t)BITS(FL_SAFETY_REGS__TRIP__FIRST, trip);
  if (__builtin_expect((snapshot->trip_latched & TRIP_DEADLINE) != 0u, 0)) {
    snapshot->trip_monitor = (uint8_t)BITS(FL_SAFETY_REGS__MONITOR__CAUSE, reg_read(REG(safety.monitor)));
  }
}

COLD void chip_write_guard(guard_command_t *command) {
  if (command->clear_trips) {
    reg_write(REG(safety.command), FIELD(FL_SAFETY_REGS__COMMAND__CLEAR_KEY, CLEAR_KEY));
  }
  reg_write(REG(safety.guard), FIELD(FL_SAFETY_REGS__GUARD__ENABLE, command->enable ? 1 : 0));
  if (command->start_auto_zero) {
    sense_start_auto_zero();
  }
  command->clear_trips = false;
  command->start_auto_zero = false;
  command->fresh = false;
}

trip_record_t chip_trip_record(uint32_t index) {
  reg_write(REG(safety.log_index), index);
  const uint32_t cause = reg_read(REG(safety.log_cause));
  trip_record_t record;
  record.valid = BITS(FL_SAFETY_REGS__LOG_CAUSE__VALID, cause) != 0u;
  record.causes = BITS(FL_SAFETY_REGS__LOG_CAUSE__CAUSE, cause);
  record.channel = BITS(FL_SAFETY_REGS__LOG_CAUSE__PHASE, cause);
  record.code_lsb = BITS(FL_SAFETY_REGS__LOG_CAUSE__CODE, cause);
  record.stamp = reg_read(REG(safety.log_time));
  return record;
}
