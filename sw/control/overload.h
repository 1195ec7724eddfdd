// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// I²t: what a current above the rated one leaves in the winding, and what one below it takes out again.
//
//   x += (i² - i_rated²) dt, x >= 0;   too hot where x > 3 i_rated² T
//
// so that twice the rated current may flow for the time T, and the rated one for ever.
#ifndef FL_OVERLOAD_H
#define FL_OVERLOAD_H

#include <stdbool.h>
#include <stdint.h>

typedef struct {
  int32_t rated_i_q17;  // at most 2^17
  uint32_t ticks;       // T, at most 2^24; 0: never too hot
} overload_settings_t;

typedef struct {
  int64_t heat;  // i_q17² ticks
} overload_t;

// One step over `ticks` control ticks, at most 64; i_q17 within the converter's range. True: too hot. About 50 clocks.
bool overload_step(overload_t *overload, const overload_settings_t *settings, int32_t i_q17, uint32_t ticks);

#endif
