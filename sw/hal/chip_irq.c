// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Interrupt controller.
#include "control/placement.h"
#include "hal/chip.h"
#include "hal/reg.h"

COLD void chip_irq_configure(uint32_t control, uint32_t deferred) {
  reg_write(REG(irq.route), control);
  reg_write(REG(irq.pending), control | deferred);
  reg_write(REG(irq.enable), control | deferred);
}

HOT uint32_t chip_irq_pending(void) { return reg_read(REG(irq.pending)); }
HOT void chip_irq_clear(uint32_t sources) { reg_write(REG(irq.pending), sources); }
uint32_t chip_tick_overruns(void) { return BITS(FL_IRQ_REGS__OVERRUN__TICK_COUNT, reg_read(REG(irq.overrun))); }
uint32_t chip_all_overruns(void) { return BITS(FL_IRQ_REGS__OVERRUN__COUNT, reg_read(REG(irq.overrun))); }
