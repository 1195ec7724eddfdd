// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Incremental encoder.
#include "control/placement.h"
#include "hal/blocks.h"
#include "hal/chip.h"
#include "hal/reg.h"

SMALL_CODE_BEGIN
void encoder_configure(const parameters_t *p) {
  reg_write(REG(encoder.filter), (uint32_t)p->encoder_filter_cycles);
  reg_write(REG(encoder.turn), FIELD(FL_ENCODER_REGS__TURN__LAST, p->encoder_quarters - 1) |
                                   FIELD(FL_ENCODER_REGS__TURN__INDEX, p->encoder_index));
}
SMALL_CODE_END

HOT void encoder_read_counters(chip_vector_snapshot_t *v) {
  const uint32_t counters = reg_read(REG(encoder.counters));
  v->encoder_invalid = (uint16_t)BITS(FL_ENCODER_REGS__COUNTERS__INVALID, counters);
  v->encoder_strayed = (uint16_t)BITS(FL_ENCODER_REGS__COUNTERS__STRAYED, counters);
}
