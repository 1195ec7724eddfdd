// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Zero crossings.
#include "control/placement.h"
#include "hal/blocks.h"
#include "hal/chip.h"
#include "hal/reg.h"

// Unclamped samples in the same on-state that a crossing's sample must follow.
#define SAMPLES_BEFORE_MIN 1u
#define SAMPLES_BEFORE_MAX (FL_ZCD_REGS__CONTROL__NEED_PREVIOUS_bm >> FL_ZCD_REGS__CONTROL__NEED_PREVIOUS_bp)

SMALL_CODE_BEGIN
void zcd_configure(const parameters_t *p) {
  reg_write(REG(zcd.blanking), FIELD(FL_ZCD_REGS__BLANKING__SETTLE_CYCLES, p->zcd_settle_cycles) |
                                   FIELD(FL_ZCD_REGS__BLANKING__BLANK_CYCLES, p->zcd_blank_cycles));
  for (uint32_t sector = 0; sector < 6u; sector++) {
    reg_write(REG(zcd.threshold[0]) + 4u * sector, (uint32_t)p->zcd_threshold_q17[sector]);
  }
}
SMALL_CODE_END

HOT void zcd_read_late(chip_snapshot_t *snapshot) {
  const uint32_t late = BITS(FL_ZCD_REGS__COUNTERS__LATE, reg_read(REG(zcd.counters)));
  snapshot->late = (uint8_t)(late - BITS(FL_ZCD_REGS__METHOD_COUNTERS__BACK, reg_read(REG(zcd.method_counters))));
}

COLD void zcd_write_thresholds(const threshold_command_t *command) {
  for (uint32_t sector = 0; sector < 6u; sector++) {
    reg_write(REG(zcd.threshold[0]) + 4u * sector, (uint32_t)command->q17[sector]);
  }
}

// A diode that lets the terminal go is an edge that no gate tells: after it the samples wait as long as after one of a gate.
// The settle time holds a sample, that of the clamp. One sample a pulse has none before it.
COLD static uint32_t samples_before(uint32_t sampling, const parameters_t *p) {
  if (sampling == SAMPLING_ONCE) {
    return 0;
  }
  const uint32_t waits = (uint32_t)p->zcd_settle_cycles / (uint32_t)p->sample_period_cycles;
  if (waits <= SAMPLES_BEFORE_MIN) {
    return SAMPLES_BEFORE_MIN;
  }
  return (waits > SAMPLES_BEFORE_MAX) ? SAMPLES_BEFORE_MAX : waits - 1u;
}

SMALL_CODE_BEGIN
// Averaging and computing back use the mean interval: the last one alternates with every asymmetry and closes a loop
// through crossings that are computed back.
void zcd_write_sequence(const sequence_command_t *command, const parameters_t *p) {
  const crossing_settings_t crossing = command->crossing;
  reg_write(REG(zcd.control), FIELD(FL_ZCD_REGS__CONTROL__ENABLE, command->zcd_enable ? 1 : 0) |
                                  FIELD(FL_ZCD_REGS__CONTROL__METHOD, crossing.zcd_method) |
                                  FIELD(FL_ZCD_REGS__CONTROL__COMPUTE_BACK, crossing.compute_back ? 1 : 0) |
                                  FIELD(FL_ZCD_REGS__CONTROL__NEED_PREVIOUS, samples_before(command->sampling, p)) |
                                  FIELD(FL_ZCD_REGS__CONTROL__LINEAR, p->zcd_linear) |
                                  FIELD(FL_ZCD_REGS__CONTROL__USE_MEAN, 1) |
                                  FIELD(FL_ZCD_REGS__CONTROL__SOURCE, crossing.zcd_source));
  reg_write(REG(zcd.clamp),
            (uint32_t)((crossing.zcd_source == ZCD_SOURCE_TERMINAL) ? p->zcd_margin_q17 : p->zcd_margin_third_q17));
}
SMALL_CODE_END

// The wait of an averaged crossing ends half-way to the commutation.
HOT void zcd_write_loop(const loop_command_t *command, uint8_t source) {
  const int32_t delay_q16 = COMMUTATION_DELAY_Q16 - command->advance_q16;
  const uint32_t peak_q17 = command->peak_q17;
  reg_write(REG(zcd.wait_limit), (delay_q16 > 0) ? (uint32_t)delay_q16 >> 9 : 0u);
  reg_write(REG(zcd.amplitude), (source == ZCD_SOURCE_TERMINAL) ? peak_q17 : peak_q17 / 3u);
}
