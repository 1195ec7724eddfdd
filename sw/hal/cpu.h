// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// The processor: critical sections against the control interrupt, fixed memory areas, stack, restart.
#ifndef FL_CPU_H
#define FL_CPU_H

#include <stdbool.h>
#include <stdint.h>

#include "ram.h"

#if defined(FL_HOST)
// Of host_chip.c, or of the simulator that the firmware drives: sim/native/cpu_host.h.
uint32_t critical_enter(void);
void critical_leave(uint32_t state);
void *cpu_parameter_block(void);
void *cpu_telemetry(void);
void *cpu_can_setup(void);
void cpu_idle(void);
// No stack of the core, and no start to go back to.
static inline bool cpu_stack_is_whole(void) { return true; }
static inline uint32_t cpu_stack_bytes(void) { return 0; }
static inline uint32_t cpu_interrupted(void) { return 0; }
static inline void cpu_restart(void) {}
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
static inline void *cpu_can_setup(void) { return (void *)RAM_CAN_SETUP; }

// The last word of the stack is as the start code has painted it.
static inline bool cpu_stack_is_whole(void) { return *(const volatile uint32_t *)RAM_STACK == STACK_PAINT; }

// Most that the stack has held since the start. Some thousand clocks.
static inline uint32_t cpu_stack_bytes(void) {
  uint32_t at = RAM_STACK;
  while (at < RAM_PARAMETER_BLOCK && *(const volatile uint32_t *)at == STACK_PAINT) {
    at += 4u;
  }
  return RAM_PARAMETER_BLOCK - at;
}

// Where a handler has interrupted the core; if the current line came in between, a place in the handler.
static inline uint32_t cpu_interrupted(void) {
  uint32_t address;
  __asm__ volatile("csrr %0, mepc" : "=r"(address));
  return address;
}

// Start the firmware anew; the registers of the chip stay as they are.
static inline void cpu_restart(void) { __asm__ volatile("j _start"); }
#endif

#endif
