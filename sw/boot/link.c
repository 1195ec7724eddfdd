#include "boot/link.h"

#include "hal/wait.h"
#include "control/crc32.h"
#include "hal/reg.h"
#include "hal/uart.h"

#define SYNC 0xA5u
#define BIT_CYCLES 50u  // 1 Mbit/s at 50 MHz, as the console
#define GAP_MS 20u      // longest pause within a frame
#define HEAD_BYTES 3u   // code, length
#define CRC_BYTES 4u

void link_configure(void) { uart_configure(BIT_CYCLES); }

static bool get(uint8_t *byte, uint32_t limit_ms) {
  const uint32_t start = wait_now();
  while (!uart_get(byte)) {
    if (limit_ms != LINK_FOREVER && wait_over(start, limit_ms)) {
      return false;
    }
  }
  return true;
}

static bool get_all(uint8_t *bytes, uint32_t count) {
  for (uint32_t i = 0; i < count; i++) {
    if (!get(&bytes[i], GAP_MS)) {
      return false;
    }
  }
  return true;
}

bool link_receive(link_frame_t *frame, uint32_t limit_ms) {
  uint8_t raw[HEAD_BYTES + LINK_PAYLOAD_BYTES + CRC_BYTES];
  const uint32_t start = wait_now();
  while (limit_ms == LINK_FOREVER || !wait_over(start, limit_ms)) {
    if (!get(raw, limit_ms) || raw[0] != SYNC || !get_all(raw, HEAD_BYTES)) {
      continue;
    }
    const uint32_t length = raw[1] | ((uint32_t)raw[2] << 8);
    if (length > LINK_PAYLOAD_BYTES || !get_all(&raw[HEAD_BYTES], length + CRC_BYTES)) {
      continue;
    }
    const uint8_t *end = &raw[HEAD_BYTES + length];
    const uint32_t crc = end[0] | ((uint32_t)end[1] << 8) | ((uint32_t)end[2] << 16) | ((uint32_t)end[3] << 24);
    if (crc32(raw, HEAD_BYTES + length) == crc) {
      frame->code = raw[0];
      frame->length = (uint16_t)length;
      for (uint32_t i = 0; i < length; i++) {
        frame->payload[i] = raw[HEAD_BYTES + i];
      }
      return true;
    }
  }
  return false;
}

void link_send(const link_frame_t *frame) {
  uint8_t raw[HEAD_BYTES + LINK_PAYLOAD_BYTES];
  const uint32_t count = HEAD_BYTES + frame->length;
  raw[0] = frame->code;
  raw[1] = (uint8_t)frame->length;
  raw[2] = (uint8_t)(frame->length >> 8);
  for (uint32_t i = 0; i < frame->length; i++) {
    raw[HEAD_BYTES + i] = frame->payload[i];
  }
  const uint32_t crc = crc32(raw, count);
  uart_put(SYNC);
  for (uint32_t i = 0; i < count; i++) {
    uart_put(raw[i]);
  }
  for (uint32_t i = 0; i < CRC_BYTES; i++) {
    uart_put((uint8_t)(crc >> (8u * i)));
  }
}

void link_say(const char *text) {
  while (*text != '\0') {
    uart_put((uint8_t)*text++);
  }
}

void link_drain(void) {
  while (BITS(FL_UART_REGS__STATUS__TX_IDLE, reg_read(REG(uart.status))) == 0u) {
  }
}
