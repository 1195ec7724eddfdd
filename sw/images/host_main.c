// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "images/host_main.h"

#include "console/console.h"
#include "hal/chip.h"
#include "hal/host/host_chip.h"

static app_t app;

void fl_host_boot(void) { app_boot(&app); }
void fl_host_current(void) { app_current_interrupt(&app); }

void fl_host_tick(void) {
  fl_host_raise(IRQ_TICK);
  app_control_interrupt(&app);
}

void fl_host_poll(void) {
  app_deferred_interrupt(&app);
  do {
    app_poll(&app);
  } while (console_waits());
}

app_t *fl_host_app(void) { return &app; }
