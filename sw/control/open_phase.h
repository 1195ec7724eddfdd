// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Phases that carry no current though the machine does, from samples of the phase currents.
//
//   quiet_k   angle, with its sign, that the rotor has turned since |i_k| was last above share * amplitude
//   open      quiet over more than an angle and at least three samples
//
// A sample whose currents do not add up to less than share * amplitude begins anew: a channel is wrong, not a phase.
//
// The sine of a sound phase is below 0.15 of its amplitude for 17 degrees at a time, twice a turn; an open phase is found
// within the angle, a sample's turn and these 17 degrees. HF current of an injection only helps: an open phase has none.
//
// A rotor at rest: waves from two directions, an eighth turn apart, drive a current through every phase.
//
//   along_k   sum of i_k, with one sign a sample for all of them: noise and offsets go. Under one wave
//   whole_k   sum of |along_k| of both, or of the second if it carries four times as much as the first
//   size_k    sum of |i_k|
//   sum       |sum of along_k| of both waves, as whole_k: a quarter of the mean of whole_k is a wrong channel's
//   open      whole_k below an eighth of their mean, with axes that differ by up to 5 a sound phase of a rotor at rest has
//             more, and size_k below half of theirs: that one of a rotor that turns under the waves is not
#ifndef FL_OPEN_PHASE_H
#define FL_OPEN_PHASE_H

#include <stdint.h>

#define OPEN_PHASES_MAX 5u

typedef struct {
  uint32_t share_q16;      // of the amplitude
  uint32_t minimum_i_q17;  // amplitude below which nothing is judged
  uint32_t turn_q32;       // electrical, below half a turn
} open_phase_settings_t;

typedef struct {
  uint32_t open;                          // bit k: phase k, stays
  uint32_t angle_q32;                     // of the last sample
  int32_t quiet_q32[OPEN_PHASES_MAX];
  uint32_t samples[OPEN_PHASES_MAX];      // quiet ones in a row
  uint32_t wave;                          // of which `along` is
  int32_t along_i_q17[OPEN_PHASES_MAX];
  int32_t whole_i_q17[OPEN_PHASES_MAX];
  int32_t mean_i_q17;                     // of all phases' whole
  int32_t sum_i_q17;                      // of all phases, under either wave
  int32_t size_i_q17[OPEN_PHASES_MAX];
  int32_t sizes_i_q17;                    // their mean
  uint32_t told;                          // first phases that the waves tell of
} open_phase_t;

// All phases sound.
void open_phase_begin(open_phase_t *state);

// One sample of `phases` <= 5 currents, the amplitude of their fundamental and the rotor's electrical angle, which turns
// by less than a quarter turn from sample to sample. Returns the phases found open so far. About 175 clocks.
uint32_t open_phase_step(open_phase_t *state, const open_phase_settings_t *settings, const int32_t *i_q17,
                         uint32_t phases, uint32_t amplitude_i_q17, uint32_t angle_q32);

// One sample under a wave, 16 000 in all at most.
void open_phase_note(open_phase_t *state, const int32_t *i_q17, uint32_t phases, uint32_t wave);

// After both. Returns the phases found open so far.
uint32_t open_phase_judge(open_phase_t *state, uint32_t phases);

#endif
