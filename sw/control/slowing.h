// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// A rotor that a drive is to stop, and that does not slow down: a load drives it, or the angle is wrong and the drive does.
//
// It slows as long as its speed follows the ramp within 1/64, or its mean falls 1/2048 below the lowest one so far. A rotor that
// takes longer than the patience for that needs two thousand times as long to stop.
#ifndef FL_SLOWING_H
#define FL_SLOWING_H

#include <stdbool.h>
#include <stdint.h>

typedef enum { SLOWING_YES, SLOWING_NO, SLOWING_FASTER } slowing_verdict_t;

typedef struct {
  int32_t first_rpm_q8;   // magnitude at the first look
  int32_t mean_rpm_q8;    // of the last looks: noise makes no lowest one that the rotor has yet to reach
  int32_t lowest_rpm_q8;  // of the mean
  uint32_t ticks;         // since there was a new lowest one
} slowing_t;

void slowing_begin(slowing_t *slowing, int32_t speed_rpm_q8);

// One look, `ticks` after the one before. Magnitudes count. SLOWING_NO: for patience_ticks; SLOWING_FASTER: for as long, and
// it turns 1/16 faster than at first. About 40 clocks.
slowing_verdict_t slowing_step(slowing_t *slowing, int32_t speed_rpm_q8, int32_t demand_rpm_q8, uint32_t ticks,
                               uint32_t patience_ticks);

#endif
