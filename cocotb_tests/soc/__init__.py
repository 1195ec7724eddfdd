"""Block tests of the chip's bus, timer, interrupts, UART, capture buffer, memory and of the chip itself."""
