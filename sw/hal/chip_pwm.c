// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Carrier and sequencer of six-step.
#include "control/placement.h"
#include "hal/blocks.h"
#include "hal/chip.h"
#include "hal/reg.h"

SMALL_CODE_BEGIN
void pwm_configure(const parameters_t *p) { reg_write(REG(pwm.min_pulse), (uint32_t)p->min_pulse_cycles); }
SMALL_CODE_END

SMALL_CODE_BEGIN
void pwm_write_sequence(const sequence_command_t *command) {
  reg_write(REG(pwm.control), FIELD(FL_PWM_REGS__CONTROL__MODE, command->sequencer) |
                                  FIELD(FL_PWM_REGS__CONTROL__COMMUTATION, command->commutation) |
                                  FIELD(FL_PWM_REGS__CONTROL__PATTERN, command->pattern) |
                                  FIELD(FL_PWM_REGS__CONTROL__SYNC_RECT, command->sync_rect ? 1 : 0) |
                                  FIELD(FL_PWM_REGS__CONTROL__BACKWARD, command->reverse ? 1 : 0) |
                                  FIELD(FL_PWM_REGS__CONTROL__START_SECTOR, command->start_sector) |
                                  FIELD(FL_PWM_REGS__CONTROL__START_HALL, command->timer == COMMUTATION_HALL ? 1 : 0));
  reg_write(REG(pwm.manual), FIELD(FL_PWM_REGS__MANUAL__LEG_A, command->leg[0]) |
                                 FIELD(FL_PWM_REGS__MANUAL__LEG_B, command->leg[1]) |
                                 FIELD(FL_PWM_REGS__MANUAL__LEG_C, command->leg[2]));
}
SMALL_CODE_END

HOT uint32_t pwm_sector(void) { return BITS(FL_PWM_REGS__STATE__SECTOR, reg_read(REG(pwm.state))); }

HOT void pwm_write_loop(const loop_command_t *command) {
  reg_write(REG(pwm.period), command->period_cycles);
  reg_write(REG(pwm.duty), command->pulse_cycles_q8);
}
