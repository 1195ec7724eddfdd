// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "hal/host/host_flash.h"

#include <string.h>

#include "hal/host/host_chip.h"
#include "hal/reg.h"
#include "hal/wait.h"
#include "ram.h"

#define IDENTITY 0xEF4016u
#define NEVER UINT32_MAX

static struct {
  uint8_t memory[HOST_FLASH_BYTES];
  uint8_t command;
  uint32_t count;  // bytes since the select
  uint32_t address;
  uint8_t page[FLASH_PAGE_BYTES];
  bool enabled;
  bool protected;
  bool off;
  uint32_t left;  // bytes to erase or program until the power goes off, less one
  uint32_t random;
} flash = {.left = NEVER};

uint8_t *fl_flash_contents(void) { return flash.memory; }
void fl_flash_protect(uint32_t protected) { flash.protected = protected != 0u; }

void fl_flash_cut(uint32_t bytes, uint32_t seed) {
  flash.left = bytes;
  flash.random = seed | 1u;
}

void fl_flash_power_up(void) {
  flash.off = false;
  flash.enabled = false;
  flash.left = NEVER;
}

static uint8_t random_byte(void) {
  flash.random ^= flash.random << 13;
  flash.random ^= flash.random >> 17;
  flash.random ^= flash.random << 5;
  return (uint8_t)(flash.random >> 8);
}

static bool is_there(uint32_t address) {
  return address >= FLASH_BLOCK && address - FLASH_BLOCK < HOST_FLASH_BYTES;
}

// All cells of a sector change together: those that power has left behind hold anything between.
static void erase(void) {
  const uint32_t base = flash.address / FLASH_SECTOR_BYTES * FLASH_SECTOR_BYTES;
  if (!is_there(base)) {
    return;
  }
  uint8_t *sector = &flash.memory[base - FLASH_BLOCK];
  for (uint32_t i = 0; i < FLASH_SECTOR_BYTES; i++) {
    if (flash.left == 0u) {
      flash.off = true;
      sector[i] |= random_byte();
    } else {
      sector[i] = 0xFF;
      flash.left -= (flash.left != NEVER) ? 1u : 0u;
    }
  }
}

static void program(void) {
  const uint32_t base = flash.address / FLASH_PAGE_BYTES * FLASH_PAGE_BYTES;
  if (!is_there(base)) {
    return;
  }
  uint8_t *page = &flash.memory[base - FLASH_BLOCK];
  for (uint32_t i = 0; i < FLASH_PAGE_BYTES && !flash.off; i++) {
    if (flash.page[i] == 0xFFu) {
      continue;
    }
    flash.off = flash.left == 0u;
    page[i] &= flash.off ? (uint8_t)(flash.page[i] | random_byte()) : flash.page[i];
    flash.left -= (flash.left != NEVER && flash.left != 0u) ? 1u : 0u;
  }
}

void host_flash_select(bool selected) {
  if (!selected && flash.count != 0u && !flash.off) {
    const bool may = flash.enabled && !flash.protected;
    if (flash.command == 0x06u) {
      flash.enabled = true;
    } else if (flash.command == 0x20u && flash.count == 4u && may) {
      erase();
      flash.enabled = false;
    } else if (flash.command == 0x02u && flash.count > 4u && may) {
      program();
      flash.enabled = false;
    }
  }
  flash.count = 0;
}

uint8_t host_flash_exchange(uint8_t byte) {
  const uint32_t n = flash.count++;
  if (flash.off) {
    // Who asks for the end of an operation waits: time passes.
    fl_host_registers()[(REG(sys.time_now) - REG_BASE) / 4u] += CLOCKS_PER_MS;
    return 0xFF;
  }
  if (n == 0u) {
    flash.command = byte;
    flash.address = 0;
    memset(flash.page, 0xFF, sizeof flash.page);
    return 0xFF;
  }
  switch (flash.command) {
    case 0x05u:  // never busy: an operation is done when its command ends
      return flash.enabled ? 2u : 0u;
    case 0x9Fu:
      return (uint8_t)(IDENTITY >> (24u - 8u * n));
    default:
      break;
  }
  if (n < 4u) {
    flash.address = flash.address << 8 | byte;
    return 0xFF;
  }
  if (flash.command == 0x02u) {
    flash.page[(flash.address + n - 4u) % FLASH_PAGE_BYTES] = byte;
  }
  if (flash.command == 0x03u && is_there(flash.address + n - 4u)) {
    return flash.memory[flash.address + n - 4u - FLASH_BLOCK];
  }
  return 0xFF;
}
