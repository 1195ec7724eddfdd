// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Runs on the core in test_fl_soc.py: visits every block, tries unmapped addresses and both interrupt lines, then
// sets the six-step path going, and the vector path when the Hall inputs show VECTOR_CODE, with voltages of the core when
// they show DIRECT_CODE. A chip of five phases has the vector path only, which goes at once. What it found goes to
// MAILBOX, where the test reads it.
#include <stdint.h>

#include "fluxlock_regs.h"

#define REG(address) (*(volatile uint32_t *)(uintptr_t)(address))
#define MAILBOX ((volatile uint32_t *)0x1E000u)
#define SCRATCH_RAM 0x8000u
#define SCRATCH_WORDS 3072u
#define CSR_EXTERNAL_MASK "0xBC0"
#define MIE_CONTROL 0x80u
#define MIE_DEFERRED 0x800u
#define SOURCE_TICK 0x01u
#define SOURCE_LOAD 0x80u
#define SOURCE_CAN 0x200u
#define VECTOR_CODE 5u
#define DIRECT_CODE 3u
#define MIE_CURRENT 0x8u
#define DIRECT_TICKS 30u

static volatile uint32_t ticks, loads, preempted, other_causes;
static volatile uint32_t control_latency_max;
static volatile uint32_t direct, currents, current_within_control, current_number, gaps;

static void put(unsigned index, uint32_t value) { MAILBOX[index] = value; }

// Voltages of a regulator step: 20000 along phase A whatever the currents are.
static void answer(void) {
  const uint32_t number = fluxlock_regs.foc.direct_run & 0xFFFFu;
  gaps = gaps + (number != ((current_number + 1u) & 0xFFFFu));
  current_number = number;
  fluxlock_regs.foc.direct_v[0] = 20000u << 8;
  fluxlock_regs.foc.direct_v[1] = 0u;
  fluxlock_regs.foc.direct_go = number;
  currents = currents + 1u;
}

// Trap: 3 = current line, 7 = control line, 11 = deferred line. The deferred handler waits inside itself for a tick, with
// `direct` the control handler for a regulator step.
__attribute__((interrupt("machine"), aligned(4))) static void trap(void) {
  uint32_t cause, epc, status;
  __asm__ volatile("csrr %0, mcause" : "=r"(cause));
  if (cause == 0x80000007u) {
    const uint32_t late = fluxlock_regs.sys.time_now - fluxlock_regs.timer.tick_time;
    if (late > control_latency_max) {
      control_latency_max = late;
    }
    fluxlock_regs.irq.pending = SOURCE_TICK;
    ticks = ticks + 1u;
    if (direct) {
      __asm__ volatile("csrr %0, mepc\n csrr %1, mstatus" : "=r"(epc), "=r"(status));
      __asm__ volatile("csrc mie, %0\n csrsi mstatus, 8" ::"r"(MIE_CONTROL | MIE_DEFERRED));
      const uint32_t before = currents;
      for (unsigned wait = 0; wait < 400u && currents == before; wait++) {
      }
      current_within_control = current_within_control + (currents != before);
      __asm__ volatile("csrci mstatus, 8\n csrs mie, %0" ::"r"(MIE_CONTROL | MIE_DEFERRED));
      __asm__ volatile("csrw mepc, %0\n csrw mstatus, %1" ::"r"(epc), "r"(status));
    }
  } else if (cause == 0x80000003u) {
    answer();
  } else if (cause == 0x8000000Bu) {
    fluxlock_regs.irq.pending = SOURCE_LOAD;
    loads = loads + 1u;
    __asm__ volatile("csrr %0, mepc\n csrr %1, mstatus" : "=r"(epc), "=r"(status));
    __asm__ volatile("csrc mie, %0\n csrsi mstatus, 8" ::"r"(MIE_DEFERRED));
    const uint32_t before = ticks;
    for (unsigned wait = 0; wait < 200u && ticks == before; wait++) {
    }
    if (ticks != before) {
      preempted = preempted + 1u;
    }
    __asm__ volatile("csrci mstatus, 8\n csrs mie, %0" ::"r"(MIE_DEFERRED));
    __asm__ volatile("csrw mepc, %0\n csrw mstatus, %1" ::"r"(epc), "r"(status));
  } else {
    other_causes = other_causes + 1u;
  }
}

static void read_every_block(void) {
  put(0, fluxlock_regs.sys.id);
  put(1, fluxlock_regs.sys.build);
  put(2, fluxlock_regs.sys.clock);
  put(3, fluxlock_regs.irq.route);
  put(4, fluxlock_regs.timer.tick_period);
  put(5, fluxlock_regs.uart.bit_time);
  put(6, fluxlock_regs.sense.period);
  put(7, fluxlock_regs.zcd.clamp);
  put(8, fluxlock_regs.comm.forced_interval);
  put(9, fluxlock_regs.pwm.period);
  put(10, fluxlock_regs.safety.dead_time);
  put(11, fluxlock_regs.capture.lanes);
  put(29, fluxlock_regs.foc.period);
  put(32, fluxlock_regs.sys.blocks);
  fluxlock_regs.sys.scratch = 0x12345678u;
  *(volatile uint8_t *)(uintptr_t)0x80000012u = 0xABu;  // byte lane of scratch
  put(12, fluxlock_regs.sys.scratch);
  const uint32_t t0 = fluxlock_regs.sys.time_now;
  const uint32_t t1 = fluxlock_regs.sys.time_now;
  put(13, t1 - t0);
}

static void try_unmapped(void) {
  static const uint32_t addresses[] = {0x00020000u, 0x00028000u, 0x40000000u, 0x7FFFFFFCu, 0x80000020u,
                                       0x80000FFCu, 0x8000C200u, 0x8000D010u, 0x8000E100u, 0x80010000u, 0x90000000u,
                                       0xFFFFFFFCu};
  uint32_t sum = 0;
  REG(SCRATCH_RAM) = 0x600DF00Du;
  for (unsigned i = 0; i < sizeof addresses / sizeof addresses[0]; i++) {
    REG(addresses[i]) = 0xDEADBEEFu;
    sum |= REG(addresses[i]);
  }
  put(14, sum);
  put(15, REG(SCRATCH_RAM));      // not hit through an alias (0x28000 = 0x8000 + 128 KiB)
  put(16, fluxlock_regs.sys.id);  // nor the first window
}

// Between the banks of a RAM smaller than its window no memory is; in a whole one the values come back.
static void try_between_banks(void) {
  static const uint32_t addresses[] = {0x00014000u, 0x0001DFFCu};
  uint32_t found = 0;
  for (unsigned i = 0; i < sizeof addresses / sizeof addresses[0]; i++) {
    REG(addresses[i]) = addresses[i];
    found += REG(addresses[i]) == addresses[i];
  }
  put(38, found);
  REG(0x00010000u) = 0x600DBA2Eu;  // a bank's first word, where there is one: not that of another
  put(39, REG(0x00010000u));
  put(40, REG(0x00000080u));  // the program's first word
}

// Three times the data cache, words and bytes, so that lines are refilled in bursts.
static void try_ram(void) {
  volatile uint32_t *words = (volatile uint32_t *)(uintptr_t)SCRATCH_RAM;
  volatile uint8_t *bytes = (volatile uint8_t *)(uintptr_t)SCRATCH_RAM;
  uint32_t wrong = 0;
  for (uint32_t i = 0; i < SCRATCH_WORDS; i++) {
    words[i] = i * 0x9E3779B1u;
  }
  for (uint32_t i = 0; i < SCRATCH_WORDS; i += 5u) {
    bytes[4u * i + (i & 3u)] = (uint8_t)i;
  }
  for (uint32_t i = 0; i < SCRATCH_WORDS; i++) {
    uint32_t expected = i * 0x9E3779B1u;
    if (i % 5u == 0u) {
      expected = (expected & ~(0xFFu << (8u * (i & 3u)))) | ((i & 0xFFu) << (8u * (i & 3u)));
    }
    wrong += words[i] != expected;
  }
  put(17, wrong);
}

uint32_t return_cause(void);

// A fetch from where no RAM is: mcause 1.
static void try_fetch(void) {
  static const uint32_t addresses[] = {0x00020000u, 0x0002E000u, 0x40000080u, 0x80000000u};
  uint32_t faults = 0;
  __asm__ volatile("csrw mtvec, %0" ::"r"(&return_cause));
  for (unsigned i = 0; i < sizeof addresses / sizeof addresses[0]; i++) {
    faults += ((uint32_t (*)(void))(uintptr_t)addresses[i])() == 1u;
  }
  if (MAILBOX[38] == 0u) {
    faults += ((uint32_t (*)(void))(uintptr_t)0x00014000u)() == 1u;
  }
  put(28, faults);
}

static void try_interrupts(void) {
  __asm__ volatile("csrw mtvec, %0" ::"r"(&trap));
  __asm__ volatile("csrw " CSR_EXTERNAL_MASK ", %0" ::"r"(1));
  fluxlock_regs.irq.pending = 0xFFu;
  fluxlock_regs.irq.enable = SOURCE_TICK | SOURCE_LOAD;
  fluxlock_regs.timer.tick_period = 997u;
  fluxlock_regs.timer.load_period = 3001u;
  __asm__ volatile("csrs mie, %0\n csrsi mstatus, 8" ::"r"(MIE_CONTROL | MIE_DEFERRED));
  while (ticks < 20u) {
  }
  __asm__ volatile("csrci mstatus, 8");
  put(18, ticks);
  put(19, loads);
  put(20, preempted);
  put(21, other_causes);
  put(22, control_latency_max);
  put(23, fluxlock_regs.irq.overrun >> 16);
  fluxlock_regs.timer.load_period = 0u;
  fluxlock_regs.irq.enable = 0u;
}

// A frame in loop-back, with its interrupt; then one on the pins, where nobody acknowledges it. 16 clocks a bit.
static void try_can(void) {
  fluxlock_regs.can.bit_timing = (11u << 8) | (2u << 16) | (1u << 24);
  fluxlock_regs.can.filter_mask[7] = 1u << 29;
  fluxlock_regs.can.event_enable = 1u;
  fluxlock_regs.can.control = 1u | 4u;
  fluxlock_regs.can.tx_id = (1u << 31) | 0x12345678u;
  fluxlock_regs.can.tx_data[0] = 0x44332211u;
  fluxlock_regs.can.tx_command = (1u << 2) | (4u << 8);
  for (unsigned wait = 0; wait < 1000u && !(fluxlock_regs.irq.pending & SOURCE_CAN); wait++) {
  }
  put(33, fluxlock_regs.irq.pending & SOURCE_CAN);
  put(34, fluxlock_regs.can.rx_id);
  put(35, fluxlock_regs.can.rx_data[0]);
  put(36, fluxlock_regs.sys.time_now - fluxlock_regs.can.rx_time);
  fluxlock_regs.can.control = 0u;
  fluxlock_regs.can.control = 1u;
  fluxlock_regs.can.tx_command = 1u | (4u << 8);
  for (unsigned wait = 0; wait < 1000u && !fluxlock_regs.can.error; wait++) {
  }
  put(37, fluxlock_regs.can.error);
  fluxlock_regs.can.control = 0u;
}

// Forced commutation every 3000 clocks under CSC, 30 % duty, samples every 50 clocks, phase over-current trip on.
static void run_six_step(void) {
  fluxlock_regs.sense.scheduler = 1u;
  fluxlock_regs.pwm.period = 500u;
  fluxlock_regs.pwm.duty = 150u << 8;
  fluxlock_regs.pwm.control = (2u << 0) | (2u << 4);
  fluxlock_regs.comm.forced_interval = 3000u;
  fluxlock_regs.comm.control = 1u;
  fluxlock_regs.timer.update = 1u;
  fluxlock_regs.safety.trip_enable = 0x07u;
  fluxlock_regs.safety.guard = 1u;
}

// A voltage along phase A at standstill: carriers of 1000 clocks, A on for 614 of them, B and C for 386, one sample 100
// clocks after the start, a control tick every second one. Five phases: 638, 533, 362, 362, 533.
static void run_vector(uint32_t by_core) {
  fluxlock_regs.safety.guard = 0u;
  fluxlock_regs.safety.trip_enable = 0x87u;
  fluxlock_regs.pwm.control = 0u;
  fluxlock_regs.comm.control = 0u;
  fluxlock_regs.sense.scheduler = 3u | (100u << 16);
  fluxlock_regs.foc.period = 1000u;
  fluxlock_regs.foc.window = 100u;
  fluxlock_regs.foc.forward[0] = by_core ? 0u : 20000u;
  fluxlock_regs.foc.limit[0] = 0x1FFFFu;
  fluxlock_regs.foc.scale = 64000u | (23u << 24);
  fluxlock_regs.foc.control = 1u | (1u << 1) | (by_core ? 1u << 6 : 1u << 3) | (3u << 8);
  fluxlock_regs.timer.update = 1u;
  while (fluxlock_regs.timer.update & 2u) {
  }
  fluxlock_regs.timer.tick_samples = 2u;
  fluxlock_regs.safety.guard = 1u;
  if (by_core) {
    loads = preempted = ticks = other_causes = 0u;
    fluxlock_regs.irq.enable = SOURCE_TICK | SOURCE_LOAD;
    fluxlock_regs.timer.load_period = 3001u;
    direct = 1u;
    __asm__ volatile("csrs mie, %0\n csrsi mstatus, 8" ::"r"(MIE_CURRENT));
    while (currents == 0u) {
    }
    gaps = 0u;
    const uint32_t from = ticks;
    while (ticks - from < DIRECT_TICKS) {
    }
    put(18, ticks - from);
    put(19, current_within_control);
    put(20, gaps);
    put(21, other_causes);
    put(22, loads);
  }
  put(30, 0x600D600Du);
}

int main(void) {
  read_every_block();
  try_unmapped();
  try_between_banks();
  try_ram();
  try_fetch();
  try_interrupts();
  try_can();
  const uint32_t five = ((fluxlock_regs.sys.build >> 16) & 0xFu) == 5u;
  if (five) {
    run_vector(0);
  } else {
    run_six_step();
  }
  put(31, 0x600D600Du);
  // The test trips the gates; after each trip clear, show the cause, and go on.
  unsigned vector = five;
  for (unsigned trip = 0;;) {
    const uint32_t code = fluxlock_regs.hall.state & 7u;
    if (!vector && (code == VECTOR_CODE || code == DIRECT_CODE)) {
      run_vector(code == DIRECT_CODE);
      vector = 1;
    }
    if (fluxlock_regs.safety.trip & 0xFFu) {
      put(24u + (trip & 3u), fluxlock_regs.safety.trip & 0xFFu);
      while ((fluxlock_regs.safety.trip >> 8) & 0x87u) {
      }
      fluxlock_regs.safety.command = 0xA500u;
      fluxlock_regs.safety.guard = 1u;
      trip++;
    }
  }
}
