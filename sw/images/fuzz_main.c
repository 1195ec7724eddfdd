// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// The firmware with a main loop that goes astray: once it is told a seed it writes and reads registers at random places
// and times, whatever they do, beside the control step that drives the machine. When that has turned the gates off, it
// brings the drive back: drive and registers as they were when it was told the seed, trips cleared with the key.
//
// At RAM_FUZZ: the seed, 0 before; the number of accesses made; a bit for each window that was accessed.
// Host side: fluxverify/campaign/fuzz.py.
#include <assert.h>
#include <stdbool.h>

#include "app/app.h"
#include "hal/can.h"
#include "hal/chip.h"
#include "hal/cpu.h"
#include "hal/reg.h"
#include "hal/soc/trap.h"
#include "ram.h"

#define WINDOW_BYTES 0x1000u
#define MAILBOX_WORDS 3u
#define PAUSE_ROUNDS 64u
#define CACHE_BYTES 4096u
#define CAN_KBIT_PER_S 1000u
// Accesses between two looks at the gates, on the average.
#define LOOK_ACCESSES 8u
// By so many the interrupts may outnumber the accesses.
#define STARVED_TRAPS 16u
// What the handlers of app.c serve.
#define CONTROL_SOURCES ((uint32_t)IRQ_TICK | (uint32_t)IRQ_TRIP)
#define DEFERRED_SOURCES ((uint32_t)IRQ_UART_RX | (uint32_t)IRQ_LOAD | (uint32_t)IRQ_MACHINE_TIMER)

// What the registers take of each window.
static const uint16_t block_bytes[] = {
    sizeof(fl_sys_regs_t),    sizeof(fl_irq_regs_t),       sizeof(fl_timer_regs_t),     sizeof(fl_uart_regs_t),
    sizeof(fl_sense_regs_t),  sizeof(fl_zcd_regs_t),       sizeof(fl_comm_regs_t),      sizeof(fl_pwm_regs_t),
    sizeof(fl_safety_regs_t), sizeof(fl_capture_regs_t),   sizeof(fl_freewheel_regs_t), sizeof(fl_hall_regs_t),
    sizeof(fl_foc_regs_t),    sizeof(fl_encoder_regs_t),   sizeof(fl_injection_regs_t), sizeof(fl_can_regs_t),
    sizeof(fl_spi_regs_t),
};
#define BLOCKS (sizeof block_bytes / sizeof block_bytes[0])
static_assert(BLOCKS == (sizeof(fluxlock_regs_t) + WINDOW_BYTES - 1u) / WINDOW_BYTES, "a block without its size");
// Not written back: a write sends a byte or counts as a report of the control step.
#define LEFT_ALONE (BLOCK_OF(uart.bit_time) | BLOCK_OF(spi.control) | BLOCK_OF(safety.guard))

static app_t app;
static volatile uint32_t *const mailbox = (volatile uint32_t *)RAM_FUZZ;
static uint32_t state;
static volatile uint32_t traps;

// Of the moment at which the seed was told.
static app_t kept;
static vector_injection_t kept_injection;
static uint32_t kept_words[BLOCKS][sizeof(fl_foc_regs_t) / 4u];  // those of the largest block

static void each_word(bool write) {
  for (uint32_t block = 0; block < BLOCKS; block++) {
    const uint32_t count = ((LEFT_ALONE >> block & 1u) == 0u) ? block_bytes[block] / 4u : 0u;
    for (uint32_t i = 0; i < count; i++) {
      const uint32_t address = REG_BASE + block * WINDOW_BYTES + 4u * i;
      if (write) {
        reg_write(address, kept_words[block][i]);
      } else {
        kept_words[block][i] = reg_read(address);
      }
    }
  }
}

static vector_injection_t *injection(void) {
  const drive_t *drive = &app.drive;
  return (drive->p != 0 && method_is_vector(drive->p->method)) ? drive->method.vector.injection : 0;
}

// Interrupts that wait are dropped: written back they would clear the later ones.
static void keep(void) {
  const uint32_t interrupts = critical_enter();
  kept = app;
  if (injection() != 0) {
    kept_injection = *injection();
  }
  chip_irq_clear(~0u);
  each_word(false);
  critical_leave(interrupts);
}

// A tick by time takes the registers over, its control step enables the guard. The ticks count on: the watchdog knows the
// last number.
static void bring_back(void) {
  const uint32_t interrupts = critical_enter();
  const uint32_t tick = app.drive.order.tick;
  app = kept;
  app.drive.order.tick = tick;
  app.drive.guard.fresh = true;
  if (injection() != 0) {
    *injection() = kept_injection;
  }
  each_word(true);
  chip_tick_by_time();
  reg_write(REG(timer.update), FIELD(FL_TIMER_REGS__UPDATE__COMMIT, 1));
  guard_command_t cleared = {.clear_trips = true};
  chip_write_guard(&cleared);
  traps = 0;
  critical_leave(interrupts);
}

// After a handler: a source that none serves would hold its line, events without end would leave the main loop no time.
static void served(uint32_t others) {
  if (state != 0u) {
    chip_irq_clear(others);
    if (++traps == STARVED_TRAPS) {
      bring_back();
    }
  }
}

void trap_current(void) { app_current_interrupt(&app); }
void trap_control(void) {
  app_control_interrupt(&app);
  served(reg_read(REG(irq.route)) & ~CONTROL_SOURCES);
}
void trap_deferred(void) {
  app_deferred_interrupt(&app);
  served(~reg_read(REG(irq.route)) & ~DEFERRED_SOURCES);
}

// Marsaglia's xorshift.
static uint32_t draw(uint32_t below) {
  state ^= state << 13;
  state ^= state >> 17;
  state ^= state << 5;
  return (state >> 8) % below;
}

// Whoever sits outside writes past the cache: make it read the line anew.
static uint32_t seed(void) {
  (void)*(mailbox - CACHE_BYTES / 4u);
  return mailbox[0];
}

// Random bits, few bits, the bytes that act as keys, or an enable.
static uint32_t word(void) {
  switch (draw(5)) {
    case 0:
      return 1u << draw(32);
    case 1:
      return 0xA500u;
    case 2:
      return 1u;
    case 3:
      return draw(1u << 12);
    default:
      (void)draw(2);
      return state;
  }
}

// One access in eight goes anywhere in the window.
static void access(void) {
  const uint32_t block = draw(BLOCKS);
  const uint32_t offset = draw((draw(8) == 0u) ? WINDOW_BYTES : block_bytes[block]);
  const uint32_t address = REG_BASE + block * WINDOW_BYTES + offset;
  mailbox[2] |= 1u << block;
  switch (draw(8)) {
    case 0:
      (void)reg_read(address & ~3u);
      break;
    case 1:
      *(volatile uint8_t *)address = (uint8_t)draw(256);
      break;
    case 2:
      *(volatile uint16_t *)(address & ~1u) = (uint16_t)draw(65536);
      break;
    default:
      reg_write(address & ~3u, word());
      break;
  }
  mailbox[1]++;
  const uint32_t interrupts = critical_enter();
  traps -= (traps > 0u) ? 1u : 0u;
  critical_leave(interrupts);
}

int main(void) {
  for (uint32_t i = 0; i < MAILBOX_WORDS; i++) {
    mailbox[i] = 0;
  }
  app_boot(&app);
  // Nobody acknowledges: the controller, where there is one, sends the frame again and again.
  can_join(can_bit_timing(chip_clock_hz(), CAN_KBIT_PER_S));
  (void)can_send(&(can_frame_t){.id = 0x555, .length = 8});
  trap_enable();
  while (state == 0u) {
    app_poll(&app);
    state = seed();
  }
  keep();
  for (;;) {
    access();
    for (uint32_t rounds = draw(PAUSE_ROUNDS); rounds > 0u; rounds--) {
      cpu_idle();
    }
    if (draw(LOOK_ACCESSES) == 0u && reg_read(REG(safety.gates)) == 0u) {
      bring_back();
    }
  }
}
