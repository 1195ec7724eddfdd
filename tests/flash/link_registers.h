// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Registers of the loader's link on this machine: whoever has loaded the library plays the chip.
#ifndef FL_LINK_REGISTERS_H
#define FL_LINK_REGISTERS_H

#include <stdint.h>

typedef uint32_t (*reader_t)(uint32_t address);
typedef void (*writer_t)(uint32_t address, uint32_t value);

void fl_link_registers(reader_t read, writer_t write);

#endif
