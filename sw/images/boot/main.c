// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// The loader: listens for a host on UART and CAN, starts what the flash holds if all of it is right, else says why and
// waits for a host.
#include "control/placement.h"
#include "hal/flash.h"
#include "images/boot/image.h"
#include "images/boot/link.h"
#include "ram.h"

SMALL_CODE_BEGIN

#ifndef LISTEN_MS
#define LISTEN_MS 200u
#endif
#define LOADER_VERSION 1u

enum { HELLO = 1, ERASE = 2, WRITE = 3, CHECK = 4, START = 5 };
enum { DONE = 0, UNKNOWN = 1, RANGE = 2, FLASH = 3, REFUSED = 4 };

void boot_main(void);

static void put_word(link_frame_t *frame, uint32_t word) {
  link_copy(&frame->payload[frame->length], (const uint8_t *)&word, sizeof word);
  frame->length += sizeof word;
}

static uint8_t erase(const link_frame_t *frame) {
  const uint32_t address = link_word(frame->payload);
  if (frame->length != 4u || address < FLASH_IMAGE || address >= FLASH_END || address % FLASH_SECTOR_BYTES != 0u) {
    return RANGE;
  }
  return flash_erase(address) ? DONE : FLASH;
}

static uint8_t write(const link_frame_t *frame) {
  const uint32_t address = link_word(frame->payload);
  if (frame->length < 5u) {
    return RANGE;
  }
  const uint32_t bytes = frame->length - 4u;
  if (address < FLASH_IMAGE || address >= FLASH_END || address % FLASH_PAGE_BYTES + bytes > FLASH_PAGE_BYTES) {
    return RANGE;
  }
  return flash_program(address, &frame->payload[4], bytes) ? DONE : FLASH;
}

// Answer to a frame, in its place.
static void serve(const link_t *link, link_frame_t *frame) {
  const uint8_t code = frame->code;
  const uint8_t result = code == HELLO || code == CHECK || code == START ? DONE
                         : code == ERASE                                 ? erase(frame)
                         : code == WRITE                                 ? write(frame)
                                                                         : UNKNOWN;
  frame->code = result;
  frame->length = 0;
  if (code == HELLO) {
    put_word(frame, LOADER_VERSION);
    put_word(frame, flash_identify());
  }
  if (code == CHECK || code == START) {
    const boot_result_t found = image_load();
    frame->code = found == BOOT_GOOD ? DONE : REFUSED;
    put_word(frame, (uint32_t)found);
    if (code == START && found == BOOT_GOOD) {
      link_send(link, frame);
      link_leave();
      image_start();
    }
  }
  link_send(link, frame);
}

static void say(boot_result_t result) {
  // In the order of boot_result_t, behind each other: pointers would take room in the ROM.
  static const char names[] =
      "no flash\0"
      "no image\0"
      "image header CRC\0"
      "image format\0"
      "image is for another chip\0"
      "image length\0"
      "image CRC\0"
      "no parameter block\0"
      "parameter block version\0"
      "parameter block length\0"
      "parameter block CRC";
  const char *name = names;
  for (uint32_t i = BOOT_NO_FLASH; i < (uint32_t)result; name++) {
    i += *name == '\0' ? 1u : 0u;
  }
  link_say("boot: not started: ");
  link_say(name);
  link_say("\r\n");
}

void boot_main(void) {
  link_t link;
  link_frame_t frame;
  link_configure(&link);
  if (!link_receive(&link, &frame, LISTEN_MS)) {
    const boot_result_t result = image_load();
    if (result == BOOT_GOOD) {
      link_leave();
      image_start();
    }
    say(result);
    link_receive(&link, &frame, LINK_FOREVER);
  }
  for (;;) {
    serve(&link, &frame);
    link_receive(&link, &frame, LINK_FOREVER);
  }
}

SMALL_CODE_END
