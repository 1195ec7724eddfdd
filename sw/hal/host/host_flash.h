// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// A stand-in for the SPI flash at the chip's pins on a host: what hal/flash.c sends it byte by byte.
//
// Erasing sets the bits of a sector, programming clears bits; both need a write enable. Power can be cut in the middle.
#ifndef FL_HOST_FLASH_H
#define FL_HOST_FLASH_H

#include <stdbool.h>
#include <stdint.h>

// Contents from FLASH_BLOCK on: sector of the parameter block, the two of stored objects.
#define HOST_FLASH_BYTES (3u * 4096u)
uint8_t *fl_flash_contents(void);

// Byte to the flash and the one that comes back meanwhile; a select pin that goes high ends a command.
uint8_t host_flash_exchange(uint8_t byte);
void host_flash_select(bool selected);

// Erases and programs do nothing from now on, or work again.
void fl_flash_protect(uint32_t protected);
// Power goes off when so many more bytes have been erased or programmed: what is under way is left half done, its bits
// by `seed`, and nothing answers until power is back.
void fl_flash_cut(uint32_t bytes, uint32_t seed);
void fl_flash_power_up(void);

#endif
