// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "console/format.h"

#include "control/fixed.h"
#include "control/placement.h"

SMALL_CODE_BEGIN

static uint32_t write_u64(char *text, uint64_t value, uint32_t least_digits) {
  char reversed[FORMAT_LENGTH];
  uint32_t n = 0;
  while (value != 0u || n < least_digits) {
    const uint64_t next = div_u64(value, 10);
    reversed[n] = (char)('0' + (char)(value - next * 10u));
    n++;
    value = next;
  }
  for (uint32_t i = 0; i < n; i++) {
    text[i] = reversed[n - 1u - i];
  }
  text[n] = '\0';
  return n;
}

void format_u32(char *text, uint32_t value) { (void)write_u64(text, value, 1); }

void format_i32(char *text, int32_t value) { format_fixed(text, value, 0, 0); }

void format_fixed(char *text, int64_t value, uint32_t fraction_bits, uint32_t decimals) {
  uint64_t scale = 1;
  for (uint32_t i = 0; i < decimals; i++) {
    scale *= 10u;
  }
  uint64_t magnitude = (value < 0) ? (uint64_t)0 - (uint64_t)value : (uint64_t)value;
  uint64_t whole = magnitude >> fraction_bits;
  const uint64_t rest = magnitude - (whole << fraction_bits);
  const uint64_t half = (fraction_bits > 0u) ? (uint64_t)1 << (fraction_bits - 1u) : 0u;
  uint64_t fraction = (rest * scale + half) >> fraction_bits;
  if (fraction >= scale) {
    fraction -= scale;
    whole++;
  }
  if (value < 0 && (whole != 0u || fraction != 0u)) {
    *text = '-';
    text++;
  }
  text += write_u64(text, whole, 1);
  if (decimals > 0u) {
    *text = '.';
    (void)write_u64(text + 1, fraction, decimals);
  }
}

void format_milli(char *text, int32_t value) {
  uint32_t magnitude = (uint32_t)value;
  if (value < 0) {
    *text = '-';
    text++;
    magnitude = 0u - magnitude;
  }
  text += write_u64(text, magnitude / 1000u, 1);
  *text = '.';
  (void)write_u64(text + 1, magnitude % 1000u, 3);
}

static bool parse_scaled(const char *text, uint32_t decimals, int32_t *value) {
  const bool negative = *text == '-';
  if (negative) {
    text++;
  }
  int64_t result = 0;
  uint32_t digits = 0;
  uint32_t after_point = 0;
  bool point = false;
  for (; *text != '\0'; text++) {
    if (*text == '.' && !point && decimals > 0u) {
      point = true;
    } else if (*text >= '0' && *text <= '9' && (!point || after_point < decimals)) {
      result = result * 10 + (*text - '0');
      digits++;
      after_point += point ? 1u : 0u;
    } else {
      return false;
    }
    if (result > INT32_MAX) {
      return false;
    }
  }
  for (; after_point < decimals; after_point++) {
    result *= 10;
  }
  if (digits == 0u || result > INT32_MAX) {
    return false;
  }
  *value = (int32_t)(negative ? -result : result);
  return true;
}

bool parse_milli(const char *text, int32_t *milli) { return parse_scaled(text, 3, milli); }
bool parse_i32(const char *text, int32_t *value) { return parse_scaled(text, 0, value); }

bool text_equal(const char *a, const char *b) {
  while (*a != '\0' && *a == *b) {
    a++;
    b++;
  }
  return *a == *b;
}

SMALL_CODE_END
