// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "console/line.h"

#include "control/placement.h"
#include "hal/uart.h"

#define CHECKSUM_LENGTH 3u  // with the star

SMALL_CODE_BEGIN

static uint8_t crc8(uint8_t crc, char c) {
  uint32_t value = crc ^ (uint8_t)c;
  for (uint32_t i = 0; i < 8u; i++) {
    value = (value << 1) ^ (((value & 0x80u) != 0u) ? 0x107u : 0u);
  }
  return (uint8_t)value;
}

static void clear(line_t *line) {
  line->length = 0;
  line->filled = line->lost = line->too_long = line->checked = false;
}

static char digit(uint32_t value) { return "0123456789ABCDEF"[value & 15u]; }

bool line_add(line_t *line, uint8_t byte) {
  const char c = (char)byte;
  if (c == '\r' || c == '\n') {
    if (!line->filled) {
      clear(line);
    }
    return line->filled;
  }
  line->filled |= c != ' ' && c != '\t';
  line->lost |= byte == UART_LOST;
  line->checked |= c == '*';
  if (line->length < line->size - 1u) {
    line->text[line->length] = c;
    line->length++;
  } else {
    line->too_long = true;
  }
  return false;
}

// Takes the checksum off; false: it is wrong, or the star is not where it belongs.
static bool checksum_is_right(line_t *line) {
  if (line->length < CHECKSUM_LENGTH) {
    return false;
  }
  char *end = &line->text[line->length - CHECKSUM_LENGTH];
  uint8_t crc = 0;
  for (const char *at = line->text; at != end; at++) {
    crc = crc8(crc, *at);
  }
  const bool right = end[0] == '*' && end[1] == digit(crc >> 4) && end[2] == digit(crc);
  *end = '\0';
  return right;
}

COLD const char *line_check(line_t *line) {
  line->text[line->length] = '\0';
  if (line->lost) {
    line->lost_lines++;
    return "bytes lost";
  }
  if (line->too_long) {
    line->too_long_lines++;
    return "line too long";
  }
  if (line->checked && !checksum_is_right(line)) {
    line->checksum_lines++;
    return "wrong checksum";
  }
  return 0;
}

void line_put(line_t *line, const char *text) {
  for (; *text != '\0'; text++) {
    if (!line->checked) {
    } else if (*text != '\n') {
      line->crc = crc8(line->crc, *text);
    } else {
      uart_put('*');
      uart_put((uint8_t)digit(line->crc >> 4));
      uart_put((uint8_t)digit(line->crc));
      line->crc = 0;
    }
    uart_put((uint8_t)*text);
  }
}

void line_answer(line_t *line, const char *error) {
  if (error != 0) {
    line_put(line, "error: ");
    line_put(line, error);
    line_put(line, "\n");
  } else {
    line_put(line, "ok\n");
  }
  clear(line);
}

SMALL_CODE_END
