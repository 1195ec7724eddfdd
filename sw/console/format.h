// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Numbers to text and back for the console, without a library.
#ifndef FL_FORMAT_H
#define FL_FORMAT_H

#include <stdbool.h>
#include <stdint.h>

// Room for any number that these functions write, with the terminating zero.
#define FORMAT_LENGTH 24u

// Decimal integer.
void format_i32(char *text, int32_t value);
void format_u32(char *text, uint32_t value);
// value / 2^fraction_bits with `decimals` decimals (0..6), rounded. 0 <= fraction_bits <= 40.
void format_fixed(char *text, int64_t value, uint32_t fraction_bits, uint32_t decimals);
// value / 1000 with three decimals.
void format_milli(char *text, int32_t value);
// Decimal number with up to three decimals, in thousandths; false: not a number or too large.
bool parse_milli(const char *text, int32_t *milli);
// Decimal integer; false: not a number or too large.
bool parse_i32(const char *text, int32_t *value);
bool text_equal(const char *a, const char *b);

#endif
