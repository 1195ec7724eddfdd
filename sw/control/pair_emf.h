// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// What the EMF of each conducting pair has more than the mean of the three: phases of unequal flux would else make the
// current, and a light rotor's speed, swing twice a turn. From the mean over the sector, of current and of the voltage
// without its part for the pair:
//
//   v = u - R i - L di/dt - k_e^2/J * integral of (i - mean i)      the last term: the rotor swings with the current
//   m = v of the sector - mean v of the sectors beside it           what falls or rises over all three cancels
//   more += m / 16, of the two others -= m / 32                     until m is 0: a lag or a wrong L only delays it
//
// As shares of the mean: the speed changes.
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

typedef struct {
  int32_t more_q20[PAIRS];    // over the mean EMF; by commutations modulo 3
  int32_t u_v_q25[2];         // told before: it is applied when the next tick has begun
  uint32_t commutations;
  uint32_t sectors;           // seen in a row, at most 2
  uint32_t ticks;             // seen of this one
  int32_t seen_v_q25;         // the voltage behind the same filter
  int32_t sum_v_q17;
  int32_t sum_i_q17;
  int32_t first_i_q25;
  int32_t last_i_q25;
  int32_t swing_v_q25;
  int32_t sector_v_q17[2];    // of the sectors before, the last one first
  int32_t sector_i_q17[2];
  int32_t mean_i_q25;
} pair_emf_t;

// Once a tick, while a sector lasts a few. u: told in this tick, without more and the EMF's shape; emf: mean of the pairs;
// i: of the pair, behind a filter that takes this shift of what is new; commutations: counted so far. About 120 clocks, more
// after a commutation, with a division.
void pair_emf_step(pair_emf_t *e, const pair_emf_gains_t *gains, int32_t u_v_q25, int32_t emf_v_q25, int32_t i_q25,
                   int32_t filter_shift, uint32_t commutations);

// Nothing is learnt in this tick: what was seen of the sector does not count.
void pair_emf_pause(pair_emf_t *e);

#endif
