// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Durations on a wrapping microsecond counter: one that is asked at least every 35 minutes is right.
#ifndef FL_CANOPEN_TIMER_H
#define FL_CANOPEN_TIMER_H

#include <stdbool.h>
#include <stdint.h>

typedef struct {
  bool running;
  uint32_t from_us;
} span_t;

static inline void span_start(span_t *span, uint32_t now_us) {
  span->running = true;
  span->from_us = now_us;
}

// The time is over; the span stops then. Of a span that is stopped: false.
static inline bool span_over(span_t *span, uint32_t now_us, uint32_t length_us) {
  if (!span->running || now_us - span->from_us < length_us) {
    return false;
  }
  span->running = false;
  return true;
}

#endif
