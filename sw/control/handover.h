// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Whether the crossings show a rotor that turns with the forced field: the test for handing the commutation to them.
//
// Two crossings with one commutation between them lie 60 degrees of the rotor apart. A late one, of a rotor that leads the
// field by more than 30 degrees, came before that commutation: the rotor is the more worth following. One that stands or swings
// shows no two in a row at a speed near that of the hand-over.
#ifndef FL_HANDOVER_H
#define FL_HANDOVER_H

#include <stdbool.h>
#include <stdint.h>

typedef struct {
  uint16_t crossings;    // counter value at the last step
  bool seen;             // one since the reset
  uint32_t commutation;  // count at which the last one came
} handover_t;

// Start from the counter as it is now.
void handover_reset(handover_t *handover, uint16_t crossings);

// Account for the crossings since the last step. commutations: count of now; interval_cycles: between the last two crossings,
// least_cycles to most_cycles count. True: two crossings have shown a rotor that turns. About 30 clocks.
bool handover_step(handover_t *handover, uint16_t crossings, uint32_t commutations, uint32_t interval_cycles,
                   uint32_t least_cycles, uint32_t most_cycles);

#endif
