// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "app/crash.h"

#include "control/placement.h"
#include "hal/chip.h"
#include "hal/cpu.h"

SMALL_CODE_BEGIN

#define MAGIC 0x43524153u
#define PAUSES_PER_S 10u

typedef struct {
  uint32_t magic;
  crash_t crash;
  uint32_t fresh;  // the firmware is not up again yet
  uint32_t check;
} record_t;

_Static_assert(RAM_CRASH + sizeof(record_t) <= RAM_FUZZ, "no room for the record");

static record_t *record(void) { return (record_t *)(void *)((uint8_t *)cpu_telemetry() + (RAM_CRASH - RAM_TELEMETRY)); }

static uint32_t check_of(const record_t *r) {
  const crash_t *c = &r->crash;
  return ~(r->magic ^ c->count ^ c->reason ^ c->cause ^ c->address ^ c->value ^ r->fresh);
}

static bool is_valid(const record_t *r) {
  return r->magic == MAGIC && r->check == check_of(r) && r->crash.reason < (uint32_t)CRASH_REASONS;
}

crash_t crash_seen(void) { return is_valid(record()) ? record()->crash : (crash_t){0}; }

fault_t crash_fault_of(crash_reason_t reason) {
  static const uint8_t faults[CRASH_REASONS] = {
      [CRASH_NONE] = FAULT_NONE,     [CRASH_EXCEPTION] = FAULT_EXCEPTION,  [CRASH_MAIN_LOOP] = FAULT_MAIN_LOOP,
      [CRASH_NODE] = FAULT_CAN_NODE, [CRASH_STACK] = FAULT_STACK_OVERFLOW,
  };
  return (fault_t)faults[reason];
}

fault_t crash_fault(void) {
  const record_t *r = record();
  return (is_valid(r) && r->fresh != 0u) ? crash_fault_of((crash_reason_t)r->crash.reason) : FAULT_NONE;
}

void crash_is_over(void) {
  record_t *r = record();
  if (is_valid(r)) {
    r->fresh = 0;
    r->check = check_of(r);
  }
}

COLD void crash(crash_reason_t reason, uint32_t cause, uint32_t address, uint32_t value) {
  record_t *r = record();
  chip_gates_off();
  const bool again = is_valid(r) && r->fresh != 0u;
  const uint32_t count = crash_seen().count + 1u;
  *r = (record_t){.magic = MAGIC, .crash = {count, (uint32_t)reason, cause, address, value}, .fresh = 1u};
  r->check = check_of(r);
  (void)critical_enter();
  for (const uint32_t start = chip_now(); again && chip_now() - start < chip_clock_hz() / PAUSES_PER_S;) {
  }
  cpu_restart();
}

SMALL_CODE_END
