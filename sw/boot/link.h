// Frames of the loader on the UART, and its lines of text. A frame: 0xA5, code, length of the payload (2 bytes), payload,
// CRC-32 of code, length and payload; little endian.
#ifndef FL_BOOT_LINK_H
#define FL_BOOT_LINK_H

#include <stdbool.h>
#include <stdint.h>

#include "ram.h"

#define LINK_PAYLOAD_BYTES (FLASH_PAGE_BYTES + 4u)
#define LINK_FOREVER 0u

typedef struct {
  uint8_t code;
  uint16_t length;
  uint8_t payload[LINK_PAYLOAD_BYTES];
} link_frame_t;

void link_configure(void);

// Wait for a whole frame that is right; a broken one is passed over without an answer. false: none began within
// limit_ms, LINK_FOREVER: no limit.
bool link_receive(link_frame_t *frame, uint32_t limit_ms);

void link_send(const link_frame_t *frame);

void link_say(const char *text);

// Until the last byte has left the chip.
void link_drain(void);

#endif
