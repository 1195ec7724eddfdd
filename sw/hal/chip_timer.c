// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Time base, control tick, load generator.
#include "control/placement.h"
#include "hal/blocks.h"
#include "hal/chip.h"
#include "hal/reg.h"

HOT uint32_t chip_tick_time(void) { return reg_read(REG(timer.tick_time)); }
void chip_set_tick(uint32_t cycles) { reg_write(REG(timer.tick_period), cycles); }
void chip_set_load(uint32_t cycles) { reg_write(REG(timer.load_period), cycles); }
void chip_set_machine_timer(uint32_t cycles) { reg_write(REG(timer.machine_period), cycles); }
void chip_tick_by_time(void) { reg_write(REG(timer.tick_samples), 0); }
void timer_tick_by_samples(uint32_t samples) { reg_write(REG(timer.tick_samples), samples); }
HOT void timer_commit(void) { reg_write(REG(timer.update), FIELD(FL_TIMER_REGS__UPDATE__COMMIT, 1)); }
HOT bool timer_has_taken(void) { return BITS(FL_TIMER_REGS__UPDATE__PENDING, reg_read(REG(timer.update))) == 0u; }
