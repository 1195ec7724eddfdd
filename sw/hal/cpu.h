// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// The processor: critical sections against the control interrupt, interrupt enable, fixed memory areas.
#ifndef FL_CPU_H
#define FL_CPU_H

#include <stdint.h>

#include "ram.h"


#if defined(FL_HOST)
// Of host_chip.c, or of the simulator that the firmware drives: sim/native/cpu_host.h.
uint32_t critical_enter(void);
void critical_leave(uint32_t state);
void *cpu_parameter_block(void);
void *cpu_telemetry(void);
const void *cpu_can_setup(void);
void cpu_idle(void);
#else
#define MSTATUS_MIE 8u

// No interrupt until critical_leave gets the returned state. Delays the control step, and with the
// current regulator in C its voltage; never an edge.
static inline uint32_t critical_enter(void) {
  uint32_t state;
  __asm__ volatile("csrrci %0, mstatus, 8" : "=r"(state) : : "memory");
  return state & MSTATUS_MIE;
}
static inline void critical_leave(uint32_t state) { __asm__ volatile("csrs mstatus, %0" : : "r"(state) : "memory"); }

// A clock, or more, in which nothing is done.
static inline void cpu_idle(void) { __asm__ volatile("nop"); }

static inline void *cpu_parameter_block(void) { return (void *)RAM_PARAMETER_BLOCK; }
static inline void *cpu_telemetry(void) { return (void *)RAM_TELEMETRY; }
static inline const void *cpu_can_setup(void) { return (const void *)RAM_CAN_SETUP; }
#endif

#endif
