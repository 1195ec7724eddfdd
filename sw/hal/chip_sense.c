// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Samples: when, corrected how, and their snapshot.
#include "control/placement.h"
#include "hal/blocks.h"
#include "hal/chip.h"
#include "hal/reg.h"

#define CHANNELS (2u * PHASES + 3u)
#define UNITY_GAIN_Q15 0x8000u
#define AUTO_ZERO_LOG2_SAMPLES 6u

// Channels: voltages and currents of the phases, DC link's voltage and current, star point.
static uint32_t current_channel(uint32_t i) { return (i < PHASES) ? PHASES + i : 2u * PHASES + 1u; }

void sense_schedule(uint32_t sampling, uint32_t offset_cycles) {
  reg_write(REG(sense.scheduler), FIELD(FL_SENSE_REGS__SCHEDULER__MODE, sampling) |
                                      FIELD(FL_SENSE_REGS__SCHEDULER__OFFSET_CYCLES, offset_cycles));
}

COLD void chip_shift_samples(const parameters_t *parameters, uint32_t cycles) {
  sense_schedule((uint32_t)parameters->sample_mode, (uint32_t)parameters->sample_offset_cycles + cycles);
}

SMALL_CODE_BEGIN
COLD void sense_configure(const parameters_t *p) {
  reg_write(REG(sense.period), (uint32_t)p->sample_period_cycles);
  reg_write(REG(sense.delay), (uint32_t)p->sense_delay_cycles);
  for (uint32_t c = 0; c < CHANNELS; c++) {
    reg_write(REG(sense.gain[0]) + 4u * c, UNITY_GAIN_Q15);
    reg_write(REG(sense.offset[0]) + 4u * c, 0);
  }
  for (uint32_t i = 0; i < CURRENT_CHANNELS; i++) {
    reg_write(REG(sense.offset[0]) + 4u * current_channel(i), CODE_MIDDLE_Q4);
  }
  sense_schedule(SAMPLING_CONTINUOUS, (uint32_t)p->sample_offset_cycles);
}
SMALL_CODE_END

HOT void sense_read_sums(chip_snapshot_t *snapshot) {
  snapshot->sample_number = reg_read(REG(sense.snap_number));
  snapshot->vdc_sum_q17 = (int32_t)reg_read(REG(sense.snap_vdc_sum));
  snapshot->idc_sum_q17 = (int32_t)reg_read(REG(sense.snap_idc_sum));
  snapshot->sum_count = reg_read(REG(sense.snap_count));
}

HOT void sense_read_voltages(chip_snapshot_t *snapshot) {
  for (uint32_t x = 0; x < PHASES; x++) {
    snapshot->v_q17[x] = (int32_t)reg_read(REG(sense.snap_channel[0]) + 4u * x);
  }
}

HOT void sense_read_currents(chip_snapshot_t *snapshot) {
  for (uint32_t x = 0; x < PHASES; x++) {
    snapshot->i_q17[x] = (int32_t)reg_read(REG(sense.snap_channel[0]) + 4u * (PHASES + x));
  }
}

COLD void chip_read_offsets(chip_snapshot_t *snapshot) {
  snapshot->auto_zero_busy = BITS(FL_SENSE_REGS__AUTO_ZERO__BUSY, reg_read(REG(sense.auto_zero))) != 0u;
  for (uint32_t i = 0; i < CURRENT_CHANNELS; i++) {
    snapshot->current_code_offset_q4[i] =
        (uint16_t)(reg_read(REG(sense.offset[0]) + 4u * current_channel(i)) & 0xFFFFu);
  }
}

SMALL_CODE_BEGIN
COLD void sense_start_auto_zero(void) {
  uint32_t mask = 0;
  for (uint32_t i = 0; i < CURRENT_CHANNELS; i++) {
    mask |= 1u << current_channel(i);
  }
  reg_write(REG(sense.auto_zero), FIELD(FL_SENSE_REGS__AUTO_ZERO__START, 1) |
                                      FIELD(FL_SENSE_REGS__AUTO_ZERO__LOG2_SAMPLES, AUTO_ZERO_LOG2_SAMPLES) |
                                      FIELD(FL_SENSE_REGS__AUTO_ZERO__MASK, mask));
}
SMALL_CODE_END
