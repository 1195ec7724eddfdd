// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Why the firmware started anew by itself, in words of RAM that the restart leaves alone. The gates are open before, and the
// drive boots into the fault of the reason. Whoever clears it may start again.
#ifndef FL_CRASH_H
#define FL_CRASH_H

#include <stdbool.h>
#include <stdint.h>

#include "drive/faults.h"

typedef enum { CRASH_NONE, CRASH_EXCEPTION, CRASH_MAIN_LOOP, CRASH_NODE, CRASH_STACK, CRASH_REASONS } crash_reason_t;

// In the order of the object 0x2025.
typedef struct {
  uint32_t count;    // restarts since power-up
  uint32_t reason;   // crash_reason_t
  uint32_t cause;    // mcause of an exception
  uint32_t address;  // mepc; of a hang, where the core was
  uint32_t value;    // mtval
} crash_t;

// What is known; all zero: no restart since power-up.
crash_t crash_seen(void);
// Fault of a reason.
fault_t crash_fault_of(crash_reason_t reason);
// Fault that the firmware boots into.
fault_t crash_fault(void);
// The firmware has been up for long enough: the next crash is another one.
void crash_is_over(void);
// Open the gates, keep the reason, start anew; after a pause of 0.1 s if crash_is_over has not been called since the last
// one. Returns on the host only.
void crash(crash_reason_t reason, uint32_t cause, uint32_t address, uint32_t value);

#endif
