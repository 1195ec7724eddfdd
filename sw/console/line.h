// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Lines of text from the UART, each carried out whole or not at all, and the replies to them.
//
// A line ends with CR or LF; a line of blanks only is none. Every other line gets one answer, `ok` or `error: TEXT`, also
// if bytes of it are missing (UART_LOST among them) or it is too long. A line may end with `*HH`: HH is the CRC-8 (polynomial
// x^8 + x^2 + x + 1, begins with 0, most significant bit first) of the bytes before the star, two digits 0..9, A..F. Every
// line of the reply to a line with a star ends with its own `*HH`.
#ifndef FL_LINE_H
#define FL_LINE_H

#include <stdbool.h>
#include <stdint.h>

typedef struct {
  char *text;
  uint32_t size;  // of text: a line has a byte less
  uint32_t length;
  uint8_t crc;    // of the reply's line
  bool filled;    // other bytes than blanks
  bool lost;      // bytes are missing
  bool too_long;
  bool checked;   // has a star: its reply has checksums
  uint32_t lost_lines, too_long_lines, checksum_lines;  // refused since boot
} line_t;

// One more byte; true: the line has ended and waits for line_answer.
bool line_add(line_t *line, uint8_t byte);
// Of an ended line: ends its text with a zero, without the checksum; the error if it must not be carried out, else 0.
const char *line_check(line_t *line);
// Text of the reply, to the UART: waits for its FIFO, main loop only.
void line_put(line_t *line, const char *text);
// The last line of the reply, 0: `ok`; makes room for the next line.
void line_answer(line_t *line, const char *error);

#endif
