// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Freewheel times.
#include "control/placement.h"
#include "hal/blocks.h"
#include "hal/chip.h"
#include "hal/reg.h"

SMALL_CODE_BEGIN
void freewheel_configure(const parameters_t *p) {
  reg_write(REG(freewheel.threshold), (uint32_t)p->freewheel_limit_q17);
  reg_write(REG(freewheel.control), FIELD(FL_FREEWHEEL_REGS__CONTROL__ENABLE, 1));
}
SMALL_CODE_END

HOT void chip_read_freewheel(chip_freewheel_t *freewheel) {
  const uint32_t count = reg_read(REG(freewheel.snap_count));
  if (count != 0u) {
    freewheel->count = count;
    freewheel->sum_cycles = reg_read(REG(freewheel.snap_sum));
    freewheel->max = reg_read(REG(freewheel.snap_max));
  }
}
