// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Unit tests in C, the same on host and core. A test is a function of CHECKs; a failed one names line and values.
#ifndef FL_UNIT_H
#define FL_UNIT_H

#include <stdint.h>

typedef struct {
  const char *name;
  void (*run)(void);
} unit_test_t;

extern uint32_t unit_failures;
void unit_put(char letter);  // where the report goes

static inline void unit_text(const char *text) {
  while (*text != '\0') unit_put(*text++);
}
static inline void unit_number(int32_t value) {
  if (value < 0) unit_put('-');
  const uint32_t left = (value < 0) ? 0u - (uint32_t)value : (uint32_t)value;
  uint32_t unit = 1;
  while (left / unit > 9u) unit *= 10u;
  for (; unit != 0u; unit /= 10u) unit_put((char)('0' + left / unit % 10u));
}
static inline void unit_check(int32_t line, int32_t got, int32_t wanted, int32_t apart) {
  const int64_t off = (int64_t)got - wanted;
  if (off >= -(int64_t)apart && off <= apart) return;
  unit_failures++;
  unit_text("line "), unit_number(line), unit_text(": "), unit_number(got);
  unit_text(", expected "), unit_number(wanted), unit_put('\n');
}
#define CHECK(got, wanted) unit_check(__LINE__, (got), (wanted), 0)
#define CHECK_NEAR(got, wanted, apart) unit_check(__LINE__, (got), (wanted), (apart))

#endif
