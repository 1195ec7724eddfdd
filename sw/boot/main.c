// The loader: listens for a host, starts what the flash holds if all of it is right, else says why and waits for a host.
#include "hal/flash.h"
#include "boot/image.h"
#include "boot/link.h"
#include "ram.h"

#ifndef LISTEN_MS
#define LISTEN_MS 200u
#endif
#define LOADER_VERSION 1u

enum { HELLO = 1, ERASE = 2, WRITE = 3, CHECK = 4, START = 5 };
enum { DONE = 0, UNKNOWN = 1, RANGE = 2, FLASH = 3, REFUSED = 4 };

void boot_main(void);

static uint32_t word_of(const uint8_t *bytes) {
  return bytes[0] | ((uint32_t)bytes[1] << 8) | ((uint32_t)bytes[2] << 16) | ((uint32_t)bytes[3] << 24);
}

static void put_word(link_frame_t *frame, uint32_t word) {
  for (uint32_t i = 0; i < 4u; i++) {
    frame->payload[frame->length++] = (uint8_t)(word >> (8u * i));
  }
}

static uint8_t erase(const link_frame_t *frame) {
  const uint32_t address = word_of(frame->payload);
  if (frame->length != 4u || address < FLASH_IMAGE || address >= FLASH_END || address % FLASH_SECTOR_BYTES != 0u) {
    return RANGE;
  }
  return flash_erase(address) ? DONE : FLASH;
}

static uint8_t write(const link_frame_t *frame) {
  const uint32_t address = word_of(frame->payload);
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
static void serve(link_frame_t *frame) {
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
      link_send(frame);
      link_drain();
      image_start();
    }
  }
  link_send(frame);
}

static void say(boot_result_t result) {
  static const char *const names[] = {"",
                                      "no flash",
                                      "no image",
                                      "image header CRC",
                                      "image format",
                                      "image is for another chip",
                                      "image length",
                                      "image CRC",
                                      "no parameter block",
                                      "parameter block version",
                                      "parameter block length",
                                      "parameter block CRC"};
  link_say("boot: not started: ");
  link_say(names[result]);
  link_say("\r\n");
}

void boot_main(void) {
  link_frame_t frame;
  link_configure();
  if (!link_receive(&frame, LISTEN_MS)) {
    const boot_result_t result = image_load();
    if (result == BOOT_GOOD) {
      image_start();
    }
    say(result);
    link_receive(&frame, LINK_FOREVER);
  }
  for (;;) {
    serve(&frame);
    link_receive(&frame, LINK_FOREVER);
  }
}
