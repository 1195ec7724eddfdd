// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Bytes in and out of the UART, by polling its FIFOs.
#ifndef FL_UART_H
#define FL_UART_H

#include <stdbool.h>
#include <stdint.h>

// In place of bytes that were lost: ASCII's SUB.
#define UART_LOST 0x1Au

void uart_configure(uint32_t bit_cycles);
// Oldest received byte; false: none, or bytes were lost here.
bool uart_get(uint8_t *byte);
// Oldest word of the receive FIFO, a byte or a mark of lost ones, as register `rx` has it; 0: none.
uint32_t uart_take(void);
// Text that such a word stands for: the byte; or of a mark UART_LOST and a line feed for each line that ended among the lost
// bytes, and UART_LOST for what was lost after these ends.
uint32_t uart_text_length(uint32_t word);
uint8_t uart_text(uint32_t word, uint32_t number);
// Since reset: bytes that a full receive FIFO has lost, frames with a wrong stop bit. 255: or more.
uint32_t uart_overruns(void);
uint32_t uart_frame_errors(void);
// Waits for room in the FIFO: main loop only.
void uart_put(uint8_t byte);
#if defined(FL_CAN)
// What the image does with each byte, and while uart_put waits: a long list must not hold off the CAN bus.
void uart_waits(void);
#endif

#endif
