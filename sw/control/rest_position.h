// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Position of a rotor at rest by injection, with the polarity of its magnet, from any angle.
//
//   two frames, 45 degrees apart: q amplitudes K sin 2(theta - phi) and -K cos 2(theta - phi), whose quotient is the
//   angle up to a half turn wherever the rotor stands: no unstable point, as a loop has it at 90 degrees
//   lock: the phase-locked loop takes what is left. The q amplitude is then below a quarter of K, or the angle is none and
//   all begins anew
//   polarity: d amplitudes A+ at i_d = +I and A- at -I. Along the magnet +I saturates, L_d falls, A grows: A+ > A- or
//   the frame is turned by a half. (A+ - A-) / (A+ + A-) below a share: "not sure"
//
// i_d goes from one to the other and back to 0 by a slope, so that the rotor, pulled along d by what the frame is off, hardly
// moves; the loop follows it. A light rotor moves all the same: one that has turned by 1/24 turn under the current, and a
// current that did not come, get half of it, from the lock on. After SEARCH_TRIES attempts the search ends without a
// result.
//
// Poles of a frame that is held: +I and -I in turns, as long as it is asked for, of an I halved until the difference that
// the search has seen is less than four times what is sure. After each of them its amplitude and the other one's tell the
// pole, as above. Sources: Yu 2022 (saliency); polarity by saturation: docs/theory/five-phase.md.
#ifndef FL_REST_POSITION_H
#define FL_REST_POSITION_H

#include <stdbool.h>
#include <stdint.h>

#include "control/complex_fixed.h"

#define SEARCH_TRIES 4u

typedef enum {
  REST_FIRST,
  REST_SECOND,
  REST_LOCK,
  REST_PLUS,
  REST_MINUS,
  REST_RELEASE,
  REST_FOUND,
  REST_NOT_SURE,   // of the polarity: the angle may be off by half a turn, or the rotor would not stand
  REST_NO_SIGNAL,  // no saliency to be seen, or no angle that holds
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
  uint32_t tries;      // attempts that have failed
  uint32_t halvings;   // of I
  int64_t sum_i_q21[2];  // of the amplitudes looked at, d and q
  int64_t sum_i_q25;     // of i_d with them
  int32_t moved_q32;     // by which the frame has turned since the lock, more than the rotor did then
  int32_t drift_q32;     // that the rotor turned a step then
  int32_t first_i_q21;  // q of the first frame
  int32_t saliency_i_q21;  // K
  int32_t d_i_q21;         // d amplitude at the lock
  int32_t plus_i_q21;
  int32_t minus_i_q21;
  int32_t current_i_q25;
  bool again;           // poles of a frame that is held
  int32_t pole;         // found there: 1 along the frame's d axis, -1 against it, 0 not sure
} rest_position_t;

typedef struct {
  int32_t turn_q32;       // by which the frame goes on, once
  int32_t current_i_q25;  // reference of i_d
  bool track;             // the loop is closed
} rest_position_command_t;

void rest_position_begin(rest_position_t *state);

// From now on the poles of a frame that is held, or no more of it. What is found is in `pole`; the frame is not turned.
void rest_position_again(rest_position_t *state, const rest_position_settings_t *settings, bool on);

// What a step has to go by.
typedef struct {
  bool fresh;              // vector_i_q21 (injection_vector_i_q21) is a new result
  complex_t vector_i_q21;
  int32_t d_i_q25;         // i_d
  int32_t turned_q32;      // by which the loop has turned the frame since the last step
  int32_t drift_q32;       // a step, by the loop's speed
} rest_position_input_t;

// One step, each control tick at the same interval. About 80 clocks, 700 at a change of phase.
rest_position_command_t rest_position_step(rest_position_t *state, const rest_position_settings_t *settings,
                                           const rest_position_input_t *in);

// Found, not sure or no signal.
static inline bool rest_position_ended(const rest_position_t *state) { return state->phase >= REST_FOUND; }

#endif
