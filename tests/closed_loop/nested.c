// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// In place of the firmware on the chip's bus: notes how its handlers interrupt each other, for the console. ( ) control
// handler, < > deferred handler, [ ] critical section. The line of a handler is up as long as it runs.
#include "hal/chip.h"
#include "hal/cpu.h"
#include "hal/soc/trap.h"
#include "hal/uart.h"

#define TICK_CYCLES 3000u
#define DEFERRED_CYCLES 40000u
#define WANTED 60u

static char notes[2u * WANTED];
static volatile uint32_t noted;

static void note(char sign) {
  if (noted < sizeof notes) {
    notes[noted++] = sign;
  }
}

static void wait(uint32_t cycles) {
  const uint32_t start = chip_now();
  while (chip_now() - start < cycles) {
  }
}

void trap_current(void) {}

void trap_control(void) {
  note('(');
  wait(TICK_CYCLES / 4u);
  chip_irq_clear(IRQ_TICK);
  note(')');
}

void trap_deferred(void) {
  note('<');
  wait(5u * TICK_CYCLES);
  chip_irq_clear(IRQ_MACHINE_TIMER);
  note('>');
}

int main(void) {
  uart_configure(50);
  chip_irq_configure(IRQ_TICK, IRQ_MACHINE_TIMER);
  chip_set_tick(TICK_CYCLES);
  chip_set_machine_timer(DEFERRED_CYCLES);
  trap_enable();
  while (noted < WANTED) {
    const uint32_t state = critical_enter();
    note('[');
    wait(DEFERRED_CYCLES);
    note(']');
    critical_leave(state);
    wait(2u * TICK_CYCLES);
  }
  (void)critical_enter();
  for (uint32_t i = 0; i < noted; i++) {
    uart_put((uint8_t)notes[i]);
  }
  uart_put('\n');
  for (;;) {
    cpu_idle();
  }
}
