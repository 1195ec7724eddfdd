// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// The firmware as a shared library: one instance, driven tick by tick from outside.
#ifndef FL_HOST_MAIN_H
#define FL_HOST_MAIN_H

#include "app/app.h"

// Boot with the parameter block and registers as they are.
void fl_host_boot(void);
// A regulator step waits: foc.direct_run and foc.direct_i must hold it.
void fl_host_current(void);
// One control tick: the snapshot registers must hold the new values.
void fl_host_tick(void);
// Deferred handlers and one round of the main loop.
void fl_host_poll(void);
// For what else of the firmware is in the library.
app_t *fl_host_app(void);

#endif
