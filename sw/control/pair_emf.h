// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// What the EMF of each conducting pair has more than the mean of the three: phases of unequal flux would else make the
// current, and a light rotor's speed, swing twice a turn. From the means over the last two ticks, in sectors of any length:
//
//   v   = u - R i - L di/dt - k_e^2/J * integral of (i - mean i) - e     the last but one: the rotor swings with the current
//   off = v - rest - e * sum of share_p more_p             share_p: of those ticks in which pair p conducted
//   rest += step off / 3,  more_p += 3/32 step (share_p - 1/3) off / e   step: a tick over the sector
//
// The current comes through a filter, so voltage and shares take the same one. What all pairs have in common is the rest's.
// As shares of the mean EMF e: the speed changes.
#ifndef FL_PAIR_EMF_H
#define FL_PAIR_EMF_H

#include <stdint.h>

#include "control/fixed.h"

#define PAIRS 3u

typedef struct {
  gain_t resistance;  // i_q25 -> v_q25: R
  gain_t inductance;  // i_q25 -> v_q25: L over a tick
  gain_t spring;      // i_q25 -> v_q25: k_e^2/J times a tick
} pair_emf_gains_t;

// A tick: its voltage, and its shares of the first two pairs; the whole tick is 2^24.
typedef struct {
  int32_t u_v_q25;
  int32_t share_q24[PAIRS - 1u];
} pair_emf_tick_t;

typedef struct {
  int32_t more_q28[PAIRS];  // over the mean EMF, their sum is 0; by commutations modulo 3
  pair_emf_tick_t told[2];  // applied when the next tick has begun
  pair_emf_tick_t seen;     // as the filter of the current would show it
  int32_t i_q25;
  int32_t mean_i_q25;
  int32_t swing_v_q25;
  int32_t rest_v_q25;
  uint32_t ticks;           // seen in a row, at most 3
} pair_emf_t;

// A tick of a pair, with other_q16 of it, 0 to 1, of another pair. pair, other: commutations modulo 3.
pair_emf_tick_t pair_emf_tick(int32_t u_v_q25, uint32_t pair, uint32_t other, int32_t other_q16);

// Once a tick. told: in this tick, without what the EMF's roundness adds; emf: mean of the pairs; i: of the pair, behind a
// filter that takes a part of 2^-filter_shift of what is new; step: 0 to 1. About 330 clocks.
void pair_emf_step(pair_emf_t *e, const pair_emf_gains_t *gains, const pair_emf_tick_t *told, int32_t emf_v_q25,
                   int32_t i_q25, int32_t filter_shift, int32_t step_q16);

// Nothing is learnt in this tick, nor from the next three.
void pair_emf_pause(pair_emf_t *e);

#endif
