// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Traps of the soft core. Current line: software interrupt, runs with interrupts off. Control line: machine timer
// interrupt, only the current line pre-empts it. Deferred line: external interrupt 0, both others pre-empt it.
#ifndef FL_TRAP_H
#define FL_TRAP_H

#include <stdint.h>

// Called by trap.S; the application provides them.
void trap_current(void);
void trap_control(void);
void trap_deferred(void);
// An exception; the gates are open. Does not return. Without one of the application's own the core stops.
void trap_exception(uint32_t cause, uint32_t address, uint32_t value);

// Let the lines interrupt from now on.
void trap_enable(void);

#endif
