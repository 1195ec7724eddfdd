// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Program of its own for the chip: writes and reads registers by a table, in its order, and waits for control ticks in
// between. What it reads goes to the console, a line of 8 hexadecimal digits each. It knows no block of the drive, so that
// it runs on every build of the chip.
#include "hal/cpu.h"
#include "hal/reg.h"
#include "hal/soc/trap.h"
#include "hal/uart.h"

#define UART_BIT_CYCLES 50u
#define READ 1u  // in the lowest bit of an address

typedef struct {
  uint32_t address;  // of the register, to be read with READ; 0: commit, and wait
  uint32_t value;    // to write; control ticks to wait for
} row_t;

typedef struct {
  uint32_t count;
  row_t row[];
} table_t;

// Nothing interrupts: no source is enabled.
void trap_current(void) {}
void trap_control(void) {}
void trap_deferred(void) {}

static void send(uint32_t value) {
  for (uint32_t shift = 32u; shift > 0u; shift -= 4u) {
    uart_put((uint8_t)"0123456789abcdef"[(value >> (shift - 4u)) & 0xFu]);
  }
  uart_put('\n');
}

int main(void) {
  const table_t *table = (const table_t *)RAM_TABLE;
  uart_configure(UART_BIT_CYCLES);
  for (uint32_t i = 0; i < table->count; i++) {
    const row_t row = table->row[i];
    if ((row.address & READ) != 0u) {
      send(reg_read(row.address - READ));
      continue;
    }
    if (row.address != 0u) {
      reg_write(row.address, row.value);
      continue;
    }
    reg_write(REG(timer.update), FIELD(FL_TIMER_REGS__UPDATE__COMMIT, 1));
    const uint32_t from = reg_read(REG(timer.tick_count));
    while (reg_read(REG(timer.tick_count)) - from < row.value) {
    }
  }
  for (;;) {
  }
}
