// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Hall sensors.
#include "control/placement.h"
#include "hal/blocks.h"
#include "hal/chip.h"
#include "hal/reg.h"

SMALL_CODE_BEGIN
void hall_configure(const parameters_t *p) { reg_write(REG(hall.filter), (uint32_t)p->hall_filter_cycles); }
SMALL_CODE_END

HOT void chip_read_hall(chip_snapshot_t *snapshot) {
  const uint32_t state = reg_read(REG(hall.state));
  const uint32_t counters = reg_read(REG(hall.counters));
  const uint32_t sector = BITS(FL_HALL_REGS__STATE__SECTOR, state);
  snapshot->hall.valid = BITS(FL_HALL_REGS__STATE__VALID, state) != 0u;
  snapshot->hall.backward = BITS(FL_HALL_REGS__STATE__BACKWARD, state) != 0u;
  snapshot->hall.sector = (uint8_t)((sector < 6u) ? sector : 0u);
  snapshot->hall.driven = (uint8_t)pwm_sector();
  snapshot->hall.edges = (uint16_t)BITS(FL_HALL_REGS__COUNTERS__EDGES, counters);
  snapshot->hall.invalid = (uint8_t)BITS(FL_HALL_REGS__COUNTERS__INVALID, counters);
  snapshot->hall.skipped = (uint8_t)BITS(FL_HALL_REGS__COUNTERS__SKIPPED, counters);
  snapshot->hall.phase_cycles = reg_read(REG(hall.phase[0]) + 4u * snapshot->hall.sector);
}

COLD void chip_read_phases(chip_snapshot_t *snapshot) {
  for (uint32_t sector = 0; sector < 6u; sector++) {
    snapshot->hall_phase_cycles[sector] = reg_read(REG(hall.phase[0]) + 4u * sector);
  }
}
