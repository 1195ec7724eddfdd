// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// The firmware as a shared library: one instance, driven tick by tick from outside.
#include "app/app.h"
#include "hal/chip.h"
#include "hal/host/host_chip.h"

static app_t app;

void fl_host_boot(void);
void fl_host_current(void);
void fl_host_tick(void);
void fl_host_poll(void);
const drive_t *fl_host_drive(void);
app_t *fl_host_app(void);

// Boot with the parameter block and registers as they are.
void fl_host_boot(void) { app_boot(&app); }

// A regulator step waits: foc.direct_run and foc.direct_i must hold it.
void fl_host_current(void) { app_current_interrupt(&app); }

// One control tick: the snapshot registers must hold the new values.
void fl_host_tick(void) {
  fl_host_raise(IRQ_TICK);
  app_control_interrupt(&app);
}

// Deferred handlers and one round of the main loop.
void fl_host_poll(void) {
  app_deferred_interrupt(&app);
  app_poll(&app);
}

const drive_t *fl_host_drive(void) { return &app.drive; }

// For what else of the firmware is in the library.
app_t *fl_host_app(void) { return &app; }
