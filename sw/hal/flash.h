// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// SPI NOR flash with the common command set: identification, write enable, page program, sector erase, status, read;
// addresses of three bytes.
#ifndef FL_FLASH_H
#define FL_FLASH_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

// The chip has the port of a flash.
bool flash_is_fitted(void);

// Manufacturer, type, capacity in bits 23..0; 0 or 0xFFFFFF: nothing answers.
uint32_t flash_identify(void);
bool flash_answers(void);

void flash_read(uint32_t address, uint8_t *data, size_t bytes);

// Erase the sector of FLASH_SECTOR_BYTES that begins at address. false: not done within ERASE_MS.
bool flash_erase(uint32_t address);

// Write up to FLASH_PAGE_BYTES within one page that has been erased, or zeros anywhere, and read them back. false: not done
// within PROGRAM_MS, or the flash holds something else.
bool flash_program(uint32_t address, const uint8_t *data, size_t bytes);

#endif
