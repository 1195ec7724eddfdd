// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// The frame of a machine that injection holds: from the amplitudes and the fundamental current of a sample to what the
// chip does next. Puts together rest position, angle error, hand-over to the EMF, phase-locked loop, angle sequence,
// cross-coupling, validity, speed loop and the references of both subspaces.
//
//   e          (1 - s) e_injection + s e_EMF, into one loop; e_injection holds from result to result
//   frame      on the saliency axis: Park at its angle, inverse Park `lead` further
//   published  frame + report + c,  c = (1 - s) c(i_q)
//   i*         (i_d* + j i_q*) exp(j c),   third subspace j k i_q* exp(3 j c)
//   i_q*       speed regulator on the speed behind a low-pass (Tian's LPF3), or given; at most the limit that the
//              validity leaves
//
// Sources: Tian 2019, Yu 2022, docs/theory/five-phase.md. All angles electrical.
#ifndef FL_INJECTION_FRAME_H
#define FL_INJECTION_FRAME_H

#include <stdbool.h>
#include <stdint.h>

#include "control/angle_sequence.h"
#include "control/cross_coupling.h"
#include "control/injection_error.h"
#include "control/injection_handover.h"
#include "control/injection_validity.h"
#include "control/pi.h"
#include "control/pll.h"
#include "control/rest_position.h"

typedef struct {
  injection_error_settings_t error;
  rest_position_settings_t rest;
  injection_handover_settings_t handover;
  injection_validity_settings_t validity;
  pll_gains_t pll;
  angle_sequence_t sequence;
  vector_machine_t machine;    // delay and period count
  cross_coupling_settings_t coupling;
  pi_gains_t speed;            // as vector_speed.h has them
  int32_t speed_filter_q16;    // share of the new speed a step
  int32_t third_q16;           // k = i_q3 / i_q
  bool third;                  // there is a second subspace, five phases; else none of what belongs to it is made
  int32_t limit_i_q25;         // of |i_q|, >= 0
  int32_t tick_cycles;         // clocks of a control tick
} injection_frame_settings_t;

// What a step has to go by.
typedef struct {
  bool fresh;  // `amplitude` is new
  injection_amplitude_t amplitude;
  complex_t current_i_q25;  // fundamental, in the frame
  int32_t emf_error_q30;    // theta - frame by the EMF
  bool emf_there;
  bool by_speed;               // else i_q* is given
  int32_t speed_turn_q36;      // wanted
  complex_t current_wanted_i_q25;  // i_d*, and i_q* unless by_speed
} injection_frame_input_t;

// For the chip, from the next sample on; turn once.
typedef struct {
  int32_t turn_q32;
  int32_t speed_turn_q36;
  int32_t lead_q32;
  int32_t report_q32;
  int32_t curve_q32;
  complex_t reference_i_q25[2];
  bool inject;
} injection_frame_command_t;

typedef struct {
  bool resting;  // the rest position is being looked for
  bool test;     // the poles are to be looked at while the frame is held
  rest_position_t rest;
  int32_t turned_q32;  // by the loop in the search's last step
  injection_handover_t handover;
  injection_validity_t validity;
  injection_amplitude_t amplitude;  // that the validity has not seen yet
  bool judge;                       // there is one
  pll_t pll;
  cross_coupling_t coupling;
  pi_state_t speed;
  int64_t filtered_q52;   // speed_turn_q36 with 16 bits more
  int32_t error_q30;      // e_injection
  int32_t curve_q32;      // c in use
  complex_t turn_q30;     // exp(j c)
  complex_t third_turn_q30;  // exp(3 j c)
  int32_t wanted_i_q25;   // i_q*
  bool limited;           // by the current
} injection_frame_t;

// Look for the rest position first, or go on from a frame that is known, at a speed.
void injection_frame_begin(injection_frame_t *state, const injection_frame_settings_t *settings, bool resting,
                           int32_t speed_turn_q36);

// One control tick. While `resting` the input's references do not count; it ends by itself if the position is found, else
// state->rest.phase tells. The validity follows a step behind its result: where every tick has a result every second one
// counts, a step that judges has no room for another. About 1900 clocks in these two steps with I/Q, else 1300; 2200
// while resting.
void injection_frame_step(injection_frame_t *state, const injection_frame_settings_t *settings,
                          const injection_frame_input_t *in, injection_frame_command_t *command);

#endif
