// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// A stand-in for the chip's register file on a host: what a program outside needs to play the chip.
//
// Registers are plain memory but for those that act: UART FIFOs, interrupt pending bits, commit, trip clear,
// auto-zero, SPI flash (host_flash.h).
#ifndef FL_HOST_CHIP_H
#define FL_HOST_CHIP_H

#include <stdbool.h>
#include <stdint.h>

#define HOST_REGISTER_WORDS 0x4000u  // sixteen windows of 4 KiB

// All registers, index = (address - base) / 4.
uint32_t *fl_host_registers(void);
// RAM areas that the firmware finds at fixed addresses on the chip.
uint8_t *fl_host_parameter_block(void);
uint8_t *fl_host_telemetry(void);
// Everything as after reset.
void fl_host_reset(void);
// Set pending bits of interrupt sources.
void fl_host_raise(uint32_t sources);
// Bytes for the firmware's receiver, raising its interrupt; returns how many fitted.
uint32_t fl_host_uart_send(const uint8_t *data, uint32_t length);
// A mark in the receiver's FIFO: bytes lost, so many lines that ended among them, whether bytes after these ends are lost.
void fl_host_uart_lose(uint32_t ends, bool begun);
// Bytes that the firmware has sent; returns how many were copied.
uint32_t fl_host_uart_receive(uint8_t *data, uint32_t length);
// Result of the next auto-zero, an offset (Q12.4 code) a channel.
int32_t *fl_host_auto_zero_offsets(void);
// Records of the capture buffer, four lanes each; who plays the chip fills them, and says in the status that they are there.
#define HOST_CAPTURE_RECORDS 1024u
int32_t *fl_host_capture(void);

#endif
