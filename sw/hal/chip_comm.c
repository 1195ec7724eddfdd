// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Intervals and the commutation timer.
#include "control/placement.h"
#include "hal/blocks.h"
#include "hal/chip.h"
#include "hal/reg.h"

SMALL_CODE_BEGIN
void comm_configure(const parameters_t *p) { reg_write(REG(comm.latency), (uint32_t)p->latency_cycles); }
SMALL_CODE_END

HOT void comm_read_crossings(chip_snapshot_t *snapshot) {
  snapshot->zc_interval_cycles = reg_read(REG(comm.snap_interval));
  snapshot->zc_period_cycles = reg_read(REG(comm.snap_period));
  const uint32_t counters = reg_read(REG(comm.snap_counters));
  snapshot->crossings = (uint16_t)BITS(FL_COMM_REGS__SNAP_COUNTERS__CROSSINGS, counters);
  snapshot->misses = (uint8_t)BITS(FL_COMM_REGS__SNAP_COUNTERS__MISSES, counters);
}

HOT void comm_read_events(chip_snapshot_t *snapshot) {
  const uint32_t events = reg_read(REG(comm.snap_events));
  snapshot->commutations = (uint16_t)BITS(FL_COMM_REGS__SNAP_EVENTS__COMMUTATIONS, events);
  snapshot->overdue = (uint8_t)BITS(FL_COMM_REGS__SNAP_EVENTS__OVERDUE, events);
  snapshot->timeouts = (uint8_t)BITS(FL_COMM_REGS__SNAP_EVENTS__TIMEOUTS, events);
}

COLD void chip_read_sectors(chip_snapshot_t *snapshot) {
  for (uint32_t sector = 0; sector < 6u; sector++) {
    snapshot->sector_interval_cycles[sector] = reg_read(REG(comm.snap_sector_interval[0]) + 4u * sector);
  }
}

COLD void comm_write_edges(const edge_command_t *command) {
  for (uint32_t sector = 0; sector < 6u; sector++) {
    reg_write(REG(comm.hall_offset[0]) + 4u * sector, (uint32_t)command->q16[sector] & 0xFFFFu);
  }
}

SMALL_CODE_BEGIN
void comm_write_sequence(const sequence_command_t *command) {
  const crossing_settings_t crossing = command->crossing;
  reg_write(REG(comm.control), FIELD(FL_COMM_REGS__CONTROL__MODE, command->timer) |
                                   FIELD(FL_COMM_REGS__CONTROL__FORCE_ON_MISS, command->force_on_miss ? 1 : 0) |
                                   FIELD(FL_COMM_REGS__CONTROL__CORRECTION_A, crossing.correction_a ? 1 : 0) |
                                   FIELD(FL_COMM_REGS__CONTROL__HALL_TIMED, 1) |
                                   FIELD(FL_COMM_REGS__CONTROL__MISS_LIMIT, command->miss_limit));
  reg_write(REG(comm.forced_interval), command->forced_interval_cycles);
}
SMALL_CODE_END

HOT void comm_write_loop(const loop_command_t *command) {
  reg_write(REG(comm.delay), FIELD(FL_COMM_REGS__DELAY__INTERVAL_Q16, COMMUTATION_DELAY_Q16) |
                                 FIELD(FL_COMM_REGS__DELAY__ADVANCE_Q16, (uint32_t)command->advance_q16 & 0xFFFFu));
  reg_write(REG(comm.timeout), command->timeout_q12);
}
