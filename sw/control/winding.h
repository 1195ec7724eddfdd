// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Whether the winding of a coasting rotor is whole, from its three line EMFs with open gates: nothing is energised.
//
// The lines of a whole winding have the same EMF, but for what its phases are unequal by. Turns that are bridged take
// their part of the EMF away: with a share f of phase A left two lines have (1 + f + f^2) / 3 of the third's square, with
// a short between A and B their line has next to none. Squares are summed over two turns at least: samples at equal steps
// of the angle give three equal sums, however few there are in a turn.
//
// A terminal that stays where it is belongs to a channel that fails, or to a leg that conducts: no verdict then. A short shows
// twice in a row, a channel that has just come back does not.
#ifndef FL_WINDING_H
#define FL_WINDING_H

#include <stdbool.h>
#include <stdint.h>

typedef enum { WINDING_UNKNOWN, WINDING_WHOLE, WINDING_SHORTED } winding_verdict_t;

typedef struct {
  uint32_t sum_q10[3];  // squares of the lines ab, bc, ca
  int32_t first_q17[3];
  uint32_t moved;    // terminals that swing, a bit each
  uint32_t signs;    // of the lines
  uint32_t changes;  // of the signs
  uint32_t samples;
  bool doubted;  // unequal the first time
} winding_t;

void winding_reset(winding_t *winding);

// One tick's terminal voltages, full scale 2^17; least_q17: the swing that shows that a terminal is alive, above noise.
// About 150 clocks.
winding_verdict_t winding_step(winding_t *winding, const int32_t v_q17[3], int32_t least_q17);

#endif
