// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Registers of the injection.
#include "control/placement.h"
#include "hal/chip.h"
#include "hal/reg.h"

#define SAMPLE_DELAY 2  // updates: a sample follows the update at which the effect of its voltage ended
#define BAND_FINE 1
#define LOW_FINE 2

static uint32_t control(const parameters_t *p, bool enable) {
  return FIELD(FL_INJECTION_REGS__CONTROL__ENABLE, enable ? 1 : 0) |
         FIELD(FL_INJECTION_REGS__CONTROL__METHOD, p->injection - 1) |
         FIELD(FL_INJECTION_REGS__CONTROL__REMOVE, p->injection_remove) | FIELD(FL_INJECTION_REGS__CONTROL__SINE, 1) |
         FIELD(FL_INJECTION_REGS__CONTROL__EDGES, 1);
}

static void write_array(uint32_t address, const int32_t *values, uint32_t count) {
  for (uint32_t i = 0; i < count; i++) {
    reg_write(address + 4u * i, (uint32_t)values[i]);
  }
}

COLD void chip_configure_injection(const parameters_t *p) {
  reg_write(REG(injection.control), control(p, false));
  // Begun with a quarter the HF current has no offset.
  reg_write(REG(injection.wave), FIELD(FL_INJECTION_REGS__WAVE__PERIOD, p->injection_period) |
                                     FIELD(FL_INJECTION_REGS__WAVE__FIRST, p->injection_period / 4));
  reg_write(REG(injection.delay), SAMPLE_DELAY);
  reg_write(REG(injection.rate), (uint32_t)p->injection_rate_turn_q36);
  reg_write(REG(injection.filter), FIELD(FL_INJECTION_REGS__FILTER__SHIFT, INJECTION_SHIFT) |
                                       FIELD(FL_INJECTION_REGS__FILTER__BAND_FINE, p->injection_fine & BAND_FINE) |
                                       FIELD(FL_INJECTION_REGS__FILTER__LOW_FINE, p->injection_fine / LOW_FINE));
  reg_write(REG(injection.amplitude[0]), (uint32_t)p->injection_v_q17);
  write_array(REG(injection.band_a1), p->injection_band, 4);
  write_array(REG(injection.low_a1), p->injection_low, 3);
}

HOT void chip_read_injection(chip_injection_snapshot_t *snapshot) {
  const uint32_t result = reg_read(REG(injection.snap_result));
  snapshot->results = (uint16_t)BITS(FL_INJECTION_REGS__SNAP_RESULT__RESULTS, result);
  snapshot->count = BITS(FL_INJECTION_REGS__SNAP_RESULT__COUNT, result);
  const uint32_t state = reg_read(REG(injection.snap_state));
  snapshot->active = BITS(FL_INJECTION_REGS__SNAP_STATE__ACTIVE, state) != 0u;
  snapshot->phase = (uint16_t)BITS(FL_INJECTION_REGS__SNAP_STATE__PHASE, state);
  snapshot->d.re = (int32_t)reg_read(REG(injection.snap_re[0]));
  snapshot->d.im = (int32_t)reg_read(REG(injection.snap_im[0]));
  snapshot->q.re = (int32_t)reg_read(REG(injection.snap_re[1]));
  snapshot->q.im = (int32_t)reg_read(REG(injection.snap_im[1]));
}

COLD void chip_write_injection(const injection_command_t *command, const parameters_t *parameters) {
  reg_write(REG(injection.control), control(parameters, command->inject) |
                                        FIELD(FL_INJECTION_REGS__CONTROL__CLEAR, command->clear ? 1 : 0));
}
