// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Position of a rotor at rest by injection, with the polarity of its magnet, from any angle.
//
//   two frames, 45 degrees apart: q amplitudes K sin 2(theta - phi) and -K cos 2(theta - phi), whose quotient is the
//   angle up to a half turn wherever the rotor stands: no unstable point, as a loop has it at 90 degrees
//   lock: the phase-locked loop takes what is left
//   polarity: d amplitudes A+ at i_d = +I and A- at -I. Along the magnet +I saturates, L_d falls, A grows: A+ > A- or
//   the frame is turned by a half. (A+ - A-) / (A+ + A-) below a share: "not sure"
//
// i_d goes from one to the other and back to 0 by a slope, so that the rotor, pulled along d by what the frame is off, hardly
// moves; the loop follows it. Sources: Yu 2022 (saliency); polarity by saturation: docs/theory/five-phase.md.
#ifndef FL_REST_POSITION_H
#define FL_REST_POSITION_H

#include <stdbool.h>
#include <stdint.h>

#include "control/complex_fixed.h"

typedef enum {
  REST_FIRST,
  REST_SECOND,
  REST_LOCK,
  REST_PLUS,
  REST_MINUS,
  REST_RELEASE,
  REST_FOUND,
  REST_NOT_SURE,   // of the polarity: the angle may be off by half a turn
  REST_NO_SIGNAL,  // no saliency to be seen
} rest_phase_t;

// Counts of results of the demodulator, each above 0.
typedef struct {
  uint32_t settle;          // left out after the frame was turned
  uint32_t frame_count;     // averaged in each of the two frames
  uint32_t lock;            // for the loop
  uint32_t current_settle;  // left out after i_d has got to its value
  uint32_t current_count;   // averaged at each of its values, below 256
  int32_t current_i_q25;    // I
  int32_t rise_i_q25;       // its change a step, above 0
  int32_t sure_q16;         // least share of A+ - A- in their sum
  int32_t minimum_i_q21;    // least K
} rest_position_settings_t;

typedef struct {
  rest_phase_t phase;
  uint32_t results;    // in this phase
  int64_t sum_i_q21;   // of the amplitudes looked at
  int32_t first_i_q21;  // q of the first frame
  int32_t plus_i_q21;
  int32_t minus_i_q21;
  int32_t current_i_q25;
} rest_position_t;

typedef struct {
  int32_t turn_q32;       // by which the frame goes on, once
  int32_t current_i_q25;  // reference of i_d
  bool track;             // the loop is closed
} rest_position_command_t;

void rest_position_begin(rest_position_t *state);

// One step, each control tick at the same interval. fresh: `vector` (injection_vector_i_q21) is a new result. About 60
// clocks, 600 at a change of phase.
rest_position_command_t rest_position_step(rest_position_t *state, const rest_position_settings_t *settings, bool fresh,
                                           complex_t vector_i_q21);

// Found, not sure or no signal.
static inline bool rest_position_ended(const rest_position_t *state) { return state->phase >= REST_FOUND; }

#endif
