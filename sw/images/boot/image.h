// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Image and parameter block in the flash: taken into the RAM and checked there.
#ifndef FL_IMAGE_H
#define FL_IMAGE_H

#include <stdint.h>

#define IMAGE_MAGIC 0x49584C46u  // "FLXI"
#define IMAGE_FORMAT 1u

// At FLASH_IMAGE; the image itself begins a page later.
typedef struct {
  uint32_t magic;
  uint32_t format;
  uint32_t map_version;        // of the registers that the firmware was compiled for
  uint32_t phases;             // of the chip that it is for
  uint32_t parameter_version;  // of the parameter block that it reads
  uint32_t length_bytes;       // multiple of 4
  uint32_t crc;                // CRC-32 of the image
  uint32_t header_crc;         // CRC-32 of the words above
} image_header_t;

typedef enum {
  BOOT_GOOD = 0,
  BOOT_NO_FLASH = 1,
  BOOT_NO_IMAGE = 2,
  BOOT_HEADER_CRC = 3,
  BOOT_FORMAT = 4,
  BOOT_CHIP = 5,
  BOOT_LENGTH = 6,
  BOOT_IMAGE_CRC = 7,
  BOOT_NO_BLOCK = 8,
  BOOT_BLOCK_VERSION = 9,
  BOOT_BLOCK_LENGTH = 10,
  BOOT_BLOCK_CRC = 11,
} boot_result_t;

// Copy image and parameter block to where they run and check them there. BOOT_GOOD: image_start may follow.
boot_result_t image_load(void);

// Leave the loader for the firmware in the RAM.
void image_start(void);

#endif
