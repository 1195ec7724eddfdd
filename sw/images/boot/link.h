// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Frames of the loader on its two lines, UART and CAN, and its lines of text.
//
// A frame: code, length of the payload (2 bytes), payload, CRC-32 of code, length and payload; little endian. On the UART
// 0xA5 goes before it. On CAN it goes in segments, frames of up to 8 bytes: bits 5..0 of the first byte count the segments
// from 0, bits 7..6 are the mark of the host's attempt, which the answer carries too; 7 bytes of the frame follow.
#ifndef FL_BOOT_LINK_H
#define FL_BOOT_LINK_H

#include <stdbool.h>
#include <stdint.h>

#include "ram.h"

#define LINK_PAYLOAD_BYTES (FLASH_PAGE_BYTES + 4u)
#define LINK_HEAD_BYTES 3u  // code, length
#define LINK_CRC_BYTES 4u
#define LINK_FOREVER 0u
// Extended identifiers, to which the node-ID is added: lower in priority than all standard ones.
#define LINK_ID_TO_LOADER 0x1FB00000u
#define LINK_ID_TO_HOST 0x1FB00100u
#define LINK_NODE_DEFAULT 0u
#define LINK_KBIT_DEFAULT 500u

typedef struct {
  uint8_t code;
  uint16_t length;
  bool on_can;   // line that it came from, and that an answer takes
  uint8_t mark;  // of the attempt, in its bits 7..6
  uint8_t payload[LINK_PAYLOAD_BYTES];
} link_frame_t;

// A frame on its way in.
typedef struct {
  bool open;       // it has begun
  uint16_t count;  // bytes of it so far
  uint8_t raw[LINK_HEAD_BYTES + LINK_PAYLOAD_BYTES + LINK_CRC_BYTES];
} link_incoming_t;

typedef struct {
  link_incoming_t uart;
  link_incoming_t can;
  uint32_t heard;   // clock of the last byte of the UART
  uint8_t segment;  // first byte of the next segment
  uint32_t node;
} link_t;

// Take both lines; node-ID and bit rate of CAN from the flash, or the defaults.
void link_configure(link_t *link);

// Wait for a whole frame that is right, on either line; a broken one is passed over without an answer. false: none
// within limit_ms, LINK_FOREVER: no limit.
bool link_receive(link_t *link, link_frame_t *frame, uint32_t limit_ms);

// On CAN an answer has three segments at most, the controller's buffers: a bus that carries nothing holds nobody up. What is
// left of the answer before is given up.
void link_send(const link_t *link, const link_frame_t *frame);

void link_say(const char *text);

void link_copy(uint8_t *to, const uint8_t *from, uint32_t count);

// Little endian, as the core.
uint32_t link_word(const uint8_t *bytes);

// Wait until the last byte has left the chip, on CAN for 0.1 s at most, and leave the bus as after a reset.
void link_leave(void);

#endif
