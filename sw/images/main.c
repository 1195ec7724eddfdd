// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// The image for the soft core, with FL_CAN the one with the CANopen node: entry from crt0, traps from trap.S.
#include "app/app.h"
#include "app/crash.h"
#if defined(FL_CAN)
#include "canopen/chip_node.h"
#endif
#include "hal/cpu.h"
#include "hal/soc/trap.h"
#include "hal/uart.h"

// Rounds of an idle loop between two looks at the console: keeps the bus quiet.
#define IDLE_ROUNDS 64u

static app_t app;

void trap_current(void) { app_current_interrupt(&app); }

void trap_control(void) { app_control_interrupt(&app); }

void trap_deferred(void) { app_deferred_interrupt(&app); }

void trap_exception(uint32_t cause, uint32_t address, uint32_t value) {
  crash(CRASH_EXCEPTION, cause, address, value);
}

#if defined(FL_CAN)
void uart_waits(void) { chip_node_poll(); }
#endif

int main(void) {
  app_boot(&app);
  trap_enable();
#if defined(FL_CAN)
  chip_node_init(&app);
  app_watch(&app, WORKS);
#else
  app_watch(&app, 1);
#endif
  for (;;) {
    app_poll(&app);
#if defined(FL_CAN)
    chip_node_poll();
#endif
    for (uint32_t i = 0; i < IDLE_ROUNDS; i++) {
      cpu_idle();
    }
  }
}
