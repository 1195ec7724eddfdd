// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "images/boot/image.h"

#include "control/crc32.h"
#include "control/placement.h"
#include "hal/flash.h"
#include "hal/reg.h"
#include "params.h"
#include "ram.h"

SMALL_CODE_BEGIN

#define ENTRY 0x80u
#define NOTHING_ANSWERS 0x00FFFFFFu

static boot_result_t load_code(image_header_t *header) {
  const uint32_t identity = flash_identify();
  if (identity == 0u || identity == NOTHING_ANSWERS) {
    return BOOT_NO_FLASH;
  }
  flash_read(FLASH_IMAGE, (uint8_t *)header, sizeof *header);
  if (header->magic != IMAGE_MAGIC) {
    return BOOT_NO_IMAGE;
  }
  if (crc32((const uint8_t *)header, offsetof(image_header_t, header_crc)) != header->header_crc) {
    return BOOT_HEADER_CRC;
  }
  if (header->format != IMAGE_FORMAT) {
    return BOOT_FORMAT;
  }
  const uint32_t build = reg_read(REG(sys.build));
  if (header->map_version != BITS(FL_SYS_REGS__BUILD__MAP_VERSION, build) ||
      header->phases != BITS(FL_SYS_REGS__BUILD__PHASES, build)) {
    return BOOT_CHIP;
  }
  if (header->length_bytes <= ENTRY || header->length_bytes > RAM_IMAGE_END || header->length_bytes % 4u != 0u) {
    return BOOT_LENGTH;
  }
  // No object lies at address 0 in the language's eyes: the loop is the compiler's to keep, hence by way of a register.
  uint8_t *ram = (uint8_t *)0;
  __asm__("" : "+r"(ram));
  flash_read(FLASH_IMAGE + FLASH_PAGE_BYTES, ram, header->length_bytes);
  return crc32(ram, header->length_bytes) == header->crc ? BOOT_GOOD : BOOT_IMAGE_CRC;
}

static boot_result_t load_block(uint32_t version) {
  parameter_block_t *block = (parameter_block_t *)RAM_PARAMETER_BLOCK;
  const uint32_t head_bytes = offsetof(parameter_block_t, parameters);
  flash_read(FLASH_BLOCK, (uint8_t *)block, head_bytes);
  if (block->magic != PARAMETER_MAGIC) {
    return BOOT_NO_BLOCK;
  }
  if (block->version != version) {
    return BOOT_BLOCK_VERSION;
  }
  if (block->length_bytes > PARAMETER_BLOCK_MAX_BYTES - head_bytes) {
    return BOOT_BLOCK_LENGTH;
  }
  flash_read(FLASH_BLOCK + head_bytes, (uint8_t *)block + head_bytes, block->length_bytes);
  return crc32((const uint8_t *)block + head_bytes, block->length_bytes) == block->crc ? BOOT_GOOD : BOOT_BLOCK_CRC;
}

boot_result_t image_load(void) {
  image_header_t header;
  const boot_result_t result = load_code(&header);
  return result == BOOT_GOOD ? load_block(header.parameter_version) : result;
}

void image_start(void) {
  // The firmware counts on a telemetry of zeros, as after configuration.
  for (volatile uint32_t *word = (volatile uint32_t *)RAM_TELEMETRY; word < (volatile uint32_t *)RAM_BYTES; word++) {
    *word = 0;
  }
  ((void (*)(void))ENTRY)();
}

SMALL_CODE_END
