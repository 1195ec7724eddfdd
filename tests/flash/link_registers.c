// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "link_registers.h"

#include "hal/reg.h"

static reader_t reader;
static writer_t writer;

void fl_link_registers(reader_t read, writer_t write) {
  reader = read;
  writer = write;
}

uint32_t reg_read(uint32_t address) { return reader(address); }
void reg_write(uint32_t address, uint32_t value) { writer(address, value); }
