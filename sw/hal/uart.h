// Bytes in and out of the UART, by polling its FIFOs.
#ifndef FL_UART_H
#define FL_UART_H

#include <stdbool.h>
#include <stdint.h>

void uart_configure(uint32_t bit_cycles);
// Oldest received byte; false: none.
bool uart_get(uint8_t *byte);
// Waits for room in the FIFO: main loop only.
void uart_put(uint8_t byte);
#if defined(FL_CAN)
// What the image does while uart_put waits: a long list of the console must not hold off the CAN bus.
void uart_waits(void);
#endif

#endif
