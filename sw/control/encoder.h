// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Electrical angle from the position of an incremental encoder.
//
//   theta = p (position + 1/2) / quarters + offset + omega * latency
//
// p pole pairs; the half quarter puts the angle in the middle of where the rotor may be. latency is what filter and
// synchronisers delay the position by.
//
// Mounting learnt: a rotor that a standing current holds swings about it like a pendulum; the middle between the extremes
// of a whole swing is where it would rest.
#ifndef FL_ENCODER_H
#define FL_ENCODER_H

#include <stdbool.h>
#include <stdint.h>

#include "control/fixed.h"

typedef struct {
  gain_t turn;  // half quarters -> 2^-32 electrical turn, shift >= 0
  uint32_t latency_cycles;
} encoder_settings_t;

typedef struct {
  uint32_t first_turn_q32;  // angle without offset when the extremes began
  int32_t lowest_turn_q32;  // extremes since, from it
  int32_t highest_turn_q32;
} encoder_swing_t;

// Angle without offset, 2^32 = one turn. About 40 clocks.
uint32_t encoder_turn_q32(const encoder_settings_t *settings, uint32_t position, int32_t speed_turn_q36);

// Sine-like error for the phase-locked loop: radians of theta - theta^, +-1. About 20 clocks.
int32_t encoder_error_q30(uint32_t encoder_turn_q32, uint32_t estimated_turn_q32);

void encoder_swing_begin(encoder_swing_t *swing, uint32_t turn_q32);

// One tick more; excursions below half an electrical turn.
void encoder_swing_step(encoder_swing_t *swing, uint32_t turn_q32);

// Middle of the extremes.
uint32_t encoder_swing_middle_q32(const encoder_swing_t *swing);

#endif
