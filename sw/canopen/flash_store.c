// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "canopen/flash_store.h"

#include "control/placement.h"
#include "hal/flash.h"
#include "ram.h"

SMALL_CODE_BEGIN

#define MAGIC_BYTES 4u

_Static_assert(4u * STORE_WORDS <= FLASH_SECTOR_BYTES, "an image is larger than its sector");

static uint32_t address_of(uint32_t slot) { return FLASH_STORE + slot * FLASH_SECTOR_BYTES; }

// The flash answers now: what was read before came from it. A dead one reads as a blank one.
static bool slot_read(void *context, uint32_t slot, void *data, uint32_t bytes) {
  (void)context;
  flash_read(address_of(slot), data, bytes);
  return flash_answers();
}

// The magic is taken away before the erase, which may be cut off anywhere, and comes last, by itself.
static bool slot_write(void *context, uint32_t slot, const void *data, uint32_t bytes) {
  (void)context;
  const uint8_t *from = data;
  static const uint8_t none[MAGIC_BYTES];
  bool done = flash_answers() && flash_program(address_of(slot), none, MAGIC_BYTES) && flash_erase(address_of(slot));
  for (uint32_t end = bytes; done && end > MAGIC_BYTES;) {
    const uint32_t page = (end - 1u) / FLASH_PAGE_BYTES * FLASH_PAGE_BYTES;
    const uint32_t begin = (page == 0u) ? MAGIC_BYTES : page;
    done = flash_program(address_of(slot) + begin, &from[begin], end - begin);
    end = begin;
  }
  return done && flash_program(address_of(slot), from, MAGIC_BYTES);
}

const storage_t *flash_storage(void) {
  static const storage_t storage = {.read = slot_read, .write = slot_write};
  return flash_is_fitted() ? &storage : 0;
}

SMALL_CODE_END
