// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "hal/uart.h"

#include "hal/reg.h"

// Data of a mark.
#define LOST_ENDS 0x7Fu
#define LOST_AFTER 0x80u

void uart_configure(uint32_t bit_cycles) { reg_write(REG(uart.bit_time), bit_cycles); }

bool uart_get(uint8_t *byte) {
  const uint32_t word = reg_read(REG(uart.rx));
  *byte = (uint8_t)BITS(FL_UART_REGS__RX__DATA, word);
  return BITS(FL_UART_REGS__RX__VALID, word) != 0u;
}

uint32_t uart_take(void) {
  const uint32_t word = reg_read(REG(uart.rx));
  return ((word & (FL_UART_REGS__RX__VALID_bm | FL_UART_REGS__RX__LOST_bm)) != 0u) ? word : 0u;
}

uint32_t uart_text_length(uint32_t word) {
  if (__builtin_expect((word & FL_UART_REGS__RX__LOST_bm) == 0u, 1)) {
    return 1;
  }
  return 2u * (word & LOST_ENDS) + (((word & LOST_AFTER) != 0u) ? 1u : 0u);
}

uint8_t uart_text(uint32_t word, uint32_t number) {
  if (__builtin_expect((word & FL_UART_REGS__RX__LOST_bm) == 0u, 1)) {
    return (uint8_t)BITS(FL_UART_REGS__RX__DATA, word);
  }
  return ((number & 1u) == 0u) ? UART_LOST : (uint8_t)'\n';
}

uint32_t uart_overruns(void) { return BITS(FL_UART_REGS__STATUS__RX_OVERRUN, reg_read(REG(uart.status))); }

uint32_t uart_frame_errors(void) { return BITS(FL_UART_REGS__STATUS__RX_FRAME_ERROR, reg_read(REG(uart.status))); }

// Text that is made more slowly than the wire takes it leaves the FIFO with room: the node has its turn with each byte.
void uart_put(uint8_t byte) {
  do {
#if defined(FL_CAN)
    uart_waits();
#endif
  } while (BITS(FL_UART_REGS__STATUS__TX_READY, reg_read(REG(uart.status))) == 0u);
  reg_write(REG(uart.tx), byte);
}
