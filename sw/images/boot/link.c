// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "images/boot/link.h"

#include "control/crc32.h"
#include "control/placement.h"
#include "hal/can.h"
#include "hal/can_setup.h"
#include "hal/reg.h"
#include "hal/uart.h"
#include "hal/wait.h"

SMALL_CODE_BEGIN

#define SYNC 0xA5u
#define BIT_CYCLES 50u  // 1 Mbit/s at 50 MHz, as the console
#define GAP_MS 20u      // longest pause within a frame on the UART
#define DRAIN_MS 100u  // longest wait for the bus: an answer takes 45 ms at 10 kbit/s
#define SEGMENT_BYTES 7u
#define PLACE 0x3Fu  // of a segment's first byte; the rest is the mark

void link_copy(uint8_t *to, const uint8_t *from, uint32_t count) {
  for (uint32_t i = 0; i < count; i++) {
    to[i] = from[i];
  }
}

uint32_t link_word(const uint8_t *bytes) {
  uint32_t word;
  link_copy((uint8_t *)&word, bytes, sizeof word);
  return word;
}

static uint32_t length_of(const uint8_t *raw) { return raw[1] | ((uint32_t)raw[2] << 8); }

void link_configure(link_t *link) {
  uint32_t setup[2] = {LINK_NODE_DEFAULT, LINK_KBIT_DEFAULT};
  uart_configure(BIT_CYCLES);
  flash_can_setup(setup);
  link->uart.open = link->can.open = false;
  link->heard = 0;
  link->segment = 0;
  link->node = setup[0];
  const can_filter_t filter = {.id = (LINK_ID_TO_LOADER + setup[0]) | CAN_ID_EXTENDED,
                               .mask = FL_CAN_REGS__FILTER_MASK__ID_bm,
                               .enable = true};
  can_set_filter(0, &filter);
  const uint32_t timing = can_bit_timing(1000u * CLOCKS_PER_MS, setup[1]);
  can_join(timing != 0u ? timing : can_bit_timing(1000u * CLOCKS_PER_MS, LINK_KBIT_DEFAULT));
}

// The next byte of a frame that has begun. true: it is whole and right; one that cannot be is given up.
static bool add(link_incoming_t *in, uint8_t byte) {
  in->raw[in->count++] = byte;
  if (in->count < LINK_HEAD_BYTES) {
    return false;
  }
  const uint32_t count = LINK_HEAD_BYTES + length_of(in->raw);
  if (count <= LINK_HEAD_BYTES + LINK_PAYLOAD_BYTES && in->count < count + LINK_CRC_BYTES) {
    return false;
  }
  in->open = false;
  return count <= LINK_HEAD_BYTES + LINK_PAYLOAD_BYTES && crc32(in->raw, count) == link_word(&in->raw[count]);
}

static bool hear_uart(link_t *link) {
  uint8_t byte;
  if (!uart_get(&byte)) {
    return false;
  }
  link_incoming_t *in = &link->uart;
  const bool late = wait_over(link->heard, GAP_MS);
  link->heard = wait_now();
  if (in->open && !late) {
    return add(in, byte);
  }
  in->open = byte == SYNC;
  in->count = 0;
  return false;
}

// The filter has let through frames to this loader only. Segments may come at any pace: other traffic goes first.
static bool hear_can(link_t *link) {
  can_frame_t segment;
  bool lost;
  if (!can_take(&segment, &lost)) {
    return false;
  }
  link_incoming_t *in = &link->can;
  const uint8_t first = segment.data[0];
  if ((first & PLACE) == 0u) {
    in->open = true;
    in->count = 0;
  } else if (first != link->segment) {
    in->open = false;
  }
  link->segment = (uint8_t)(first + 1u);
  for (uint32_t i = 1; i < segment.length && in->open; i++) {
    if (add(in, segment.data[i])) {
      return true;
    }
  }
  return false;
}

bool link_receive(link_t *link, link_frame_t *frame, uint32_t limit_ms) {
  const uint32_t start = wait_now();
  while (limit_ms == LINK_FOREVER || !wait_over(start, limit_ms)) {
    const bool on_can = hear_can(link);
    if (on_can || hear_uart(link)) {
      const uint8_t *raw = on_can ? link->can.raw : link->uart.raw;
      frame->code = raw[0];
      frame->length = (uint16_t)length_of(raw);
      frame->on_can = on_can;
      frame->mark = link->segment & (uint8_t)~PLACE;
      link_copy(frame->payload, &raw[LINK_HEAD_BYTES], frame->length);
      return true;
    }
  }
  return false;
}

static uint32_t can_pending(void) { return BITS(FL_CAN_REGS__STATUS__PENDING, reg_read(REG(can.status))); }

// Wait until the buffers are empty, give up what they hold otherwise.
static void clear_buffers(void) {
  const uint32_t start = wait_now();
  while (can_pending() != 0u && !wait_over(start, DRAIN_MS)) {
  }
  reg_write(REG(can.tx_command), FL_CAN_REGS__TX_COMMAND__ABORT0_bm | FL_CAN_REGS__TX_COMMAND__ABORT1_bm |
                                     FL_CAN_REGS__TX_COMMAND__ABORT2_bm);
}

static void send_segments(const link_t *link, const uint8_t *raw, uint32_t count, uint8_t mark) {
  clear_buffers();
  can_frame_t segment = {.id = (LINK_ID_TO_HOST + link->node) | CAN_ID_EXTENDED};
  for (uint32_t at = 0; at < count; at += SEGMENT_BYTES) {
    const uint32_t bytes = count - at < SEGMENT_BYTES ? count - at : SEGMENT_BYTES;
    segment.data[0] = mark++;
    link_copy(&segment.data[1], &raw[at], bytes);
    segment.length = (uint8_t)(1u + bytes);
    can_send(&segment);
  }
}

void link_send(const link_t *link, const link_frame_t *frame) {
  uint8_t raw[LINK_HEAD_BYTES + LINK_PAYLOAD_BYTES + LINK_CRC_BYTES];
  const uint32_t count = LINK_HEAD_BYTES + frame->length;
  raw[0] = frame->code;
  raw[1] = (uint8_t)frame->length;
  raw[2] = (uint8_t)(frame->length >> 8);
  link_copy(&raw[LINK_HEAD_BYTES], frame->payload, frame->length);
  const uint32_t crc = crc32(raw, count);
  link_copy(&raw[count], (const uint8_t *)&crc, sizeof crc);
  if (frame->on_can) {
    send_segments(link, raw, count + LINK_CRC_BYTES, frame->mark);
    return;
  }
  uart_put(SYNC);
  for (uint32_t i = 0; i < count + LINK_CRC_BYTES; i++) {
    uart_put(raw[i]);
  }
}

void link_say(const char *text) {
  while (*text != '\0') {
    uart_put((uint8_t)*text++);
  }
}

void link_leave(void) {
  while (BITS(FL_UART_REGS__STATUS__TX_IDLE, reg_read(REG(uart.status))) == 0u) {
  }
  clear_buffers();
  reg_write(REG(can.control), FL_CAN_REGS__CONTROL__RECOVER_bm);
}

SMALL_CODE_END
