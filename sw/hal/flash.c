// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "hal/flash.h"

#include "hal/wait.h"
#include "hal/reg.h"
#include "ram.h"

#define COMMAND_PROGRAM 0x02u
#define COMMAND_READ 0x03u
#define COMMAND_STATUS 0x05u
#define COMMAND_WRITE_ENABLE 0x06u
#define COMMAND_ERASE 0x20u
#define COMMAND_IDENTIFY 0x9Fu
#define STATUS_BUSY 1u
// Five times the longest time of common parts.
#define ERASE_MS 2000u
#define PROGRAM_MS 25u
#define NOTHING_ANSWERS 0xFFFFFFu
#define HALF_CYCLES 2u  // 12.5 MHz at 50 MHz

static void select(bool selected) {
  reg_write(REG(spi.control),
            FIELD(FL_SPI_REGS__CONTROL__SELECT, selected) | FIELD(FL_SPI_REGS__CONTROL__HALF_CYCLES, HALF_CYCLES));
}

static uint8_t exchange(uint8_t byte) {
  uint32_t word;
  reg_write(REG(spi.tx), byte);
  do {
    word = reg_read(REG(spi.rx));
  } while (BITS(FL_SPI_REGS__RX__BUSY, word) != 0u);
  return (uint8_t)BITS(FL_SPI_REGS__RX__DATA, word);
}

static void command(uint8_t code) {
  select(true);
  exchange(code);
}

static void command_at(uint8_t code, uint32_t address) {
  command(code);
  exchange((uint8_t)(address >> 16));
  exchange((uint8_t)(address >> 8));
  exchange((uint8_t)address);
}

static bool finish(uint32_t limit_ms) {
  const uint32_t start = wait_now();
  uint8_t status;
  do {
    command(COMMAND_STATUS);
    status = exchange(0);
    select(false);
  } while ((status & STATUS_BUSY) != 0u && !wait_over(start, limit_ms));
  return (status & STATUS_BUSY) == 0u;
}

static void enable_write(void) {
  command(COMMAND_WRITE_ENABLE);
  select(false);
}

bool flash_is_fitted(void) { return (reg_read(REG(sys.blocks)) & BLOCK_OF(spi.control)) != 0u; }

uint32_t flash_identify(void) {
  uint32_t identity = 0;
  command(COMMAND_IDENTIFY);
  for (uint32_t i = 0; i < 3u; i++) {
    identity = (identity << 8) | exchange(0);
  }
  select(false);
  return identity;
}

bool flash_answers(void) {
  const uint32_t identity = flash_identify();
  return identity != 0u && identity != NOTHING_ANSWERS;
}

void flash_read(uint32_t address, uint8_t *data, size_t bytes) {
  command_at(COMMAND_READ, address);
  for (size_t i = 0; i < bytes; i++) {
    data[i] = exchange(0);
  }
  select(false);
}

bool flash_erase(uint32_t address) {
  enable_write();
  command_at(COMMAND_ERASE, address);
  select(false);
  return finish(ERASE_MS);
}

bool flash_program(uint32_t address, const uint8_t *data, size_t bytes) {
  enable_write();
  command_at(COMMAND_PROGRAM, address);
  for (size_t i = 0; i < bytes; i++) {
    exchange(data[i]);
  }
  select(false);
  if (!finish(PROGRAM_MS)) {
    return false;
  }
  bool same = true;
  command_at(COMMAND_READ, address);
  for (size_t i = 0; i < bytes; i++) {
    same = exchange(0) == data[i] && same;
  }
  select(false);
  return same;
}
