// The firmware with a main loop that goes astray: once it is told a seed it writes and reads registers at random places
// and times, whatever they do, beside the control step that drives the machine.
//
// At RAM_FUZZ: the seed, 0 before; the number of accesses made; the last address; a bit for each window that was accessed.
// An odd seed does not write the two registers whose task is to turn the gates off. Host side: fluxlock/campaign/fuzz.py.
#include <stdbool.h>

#include "app/app.h"
#include "hal/cpu.h"
#include "hal/reg.h"
#include "hal/soc/trap.h"
#include "ram.h"

#define WINDOW_BYTES 0x1000u
#define BLOCKS ((sizeof(fluxlock_regs_t) + WINDOW_BYTES - 1u) / WINDOW_BYTES)
// Registers lie in the first bytes of their windows; one access in eight goes anywhere in the window.
#define DENSE_BYTES 0x140u
#define PAUSE_CLOCKS 512u
#define CACHE_BYTES 4096u

static app_t app;

void trap_current(void) { app_current_interrupt(&app); }
void trap_control(void) { app_control_interrupt(&app); }
void trap_deferred(void) { app_deferred_interrupt(&app); }

static uint32_t state;
static bool sparing;

// Marsaglia's xorshift.
static uint32_t draw(uint32_t below) {
  state ^= state << 13;
  state ^= state >> 17;
  state ^= state << 5;
  return (state >> 8) % below;
}

// Whoever sits outside writes past the cache: make it read the line anew.
static uint32_t seed(volatile uint32_t *mailbox) {
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

// guard: enable; command: software trip.
static bool turns_off(uint32_t address) {
  return (address & ~3u) == REG(safety.guard) || (address & ~3u) == REG(safety.command);
}

static void access(volatile uint32_t *mailbox) {
  const uint32_t block = draw(BLOCKS);
  const uint32_t window = REG_BASE + block * WINDOW_BYTES;
  const uint32_t offset = (draw(8) == 0u) ? draw(WINDOW_BYTES) : draw(DENSE_BYTES);
  const uint32_t address = window + offset;
  const uint32_t kind = draw(8);
  mailbox[2] = address;
  mailbox[3] |= 1u << block;
  switch ((sparing && turns_off(address)) ? 0u : kind) {
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
}

int main(void) {
  volatile uint32_t *const mailbox = (volatile uint32_t *)RAM_FUZZ;
  mailbox[0] = 0;
  mailbox[1] = 0;
  mailbox[3] = 0;
  app_boot(&app);
  trap_enable();
  for (;;) {
    if (state == 0u) {
      app_poll(&app);
      state = seed(mailbox);
      sparing = (state & 1u) != 0u;
    } else {
      access(mailbox);
      for (uint32_t clocks = draw(PAUSE_CLOCKS); clocks > 0u; clocks--) {
        __asm__ volatile("nop");
      }
    }
  }
}
