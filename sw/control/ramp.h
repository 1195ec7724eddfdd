// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Speed ramp with an acceleration limit that waits while a limit keeps the machine from following.
//
// The reference moves toward the target by at most `step` a call and never leaves a window around the measured
// speed on the side on which it moves: without it a current-limited machine would collect a speed error.
#ifndef FL_RAMP_H
#define FL_RAMP_H

#include <stdint.h>

typedef struct {
  int32_t value_rpm_q8;
  uint32_t carry_q12;  // part of a step below 1/256 r/min, kept for the next
} ramp_t;

// Start at the given speed.
void ramp_preset(ramp_t *ramp, int32_t value_rpm_q8);

// One step. step_rpm_q20 > 0: largest change; window_rpm_q8: largest lead over the measured speed. Speeds below
// 2^29 (2 million r/min). Returns the direction toward the target, 0 there: -1, 0, +1. About 40 clocks.
int32_t ramp_step(ramp_t *ramp, int32_t target_rpm_q8, int32_t step_rpm_q20, int32_t measured_rpm_q8,
                  int32_t window_rpm_q8);

#endif
