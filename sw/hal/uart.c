#include "hal/uart.h"

#include "hal/reg.h"

void uart_configure(uint32_t bit_cycles) { reg_write(REG(uart.bit_time), bit_cycles); }

bool uart_get(uint8_t *byte) {
  const uint32_t word = reg_read(REG(uart.rx));
  *byte = (uint8_t)BITS(FL_UART_REGS__RX__DATA, word);
  return BITS(FL_UART_REGS__RX__VALID, word) != 0u;
}

void uart_put(uint8_t byte) {
  while (BITS(FL_UART_REGS__STATUS__TX_READY, reg_read(REG(uart.status))) == 0u) {
#if defined(FL_CAN)
    uart_waits();
#endif
  }
  reg_write(REG(uart.tx), byte);
}
