// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// A voltage channel that shows one code while the others swing: it does not follow its terminal.
//
// A channel that works never repeats its value for long: of a turning rotor every terminal sweeps its whole range in a
// turn, and the converter adds noise.
#ifndef FL_STUCK_H
#define FL_STUCK_H

#include <stdbool.h>
#include <stdint.h>

typedef struct {
  int32_t last_q17[3];
  uint32_t same_ticks[3];
  uint32_t quiet_ticks;  // since the last EMF
} stuck_t;

void stuck_reset(stuck_t *stuck);

// One tick's terminal voltages; emf: their spread shows a turning rotor. True: one or two of the channels have kept their
// value for `limit` ticks. The spread may vanish for a fifth of them: with a channel at zero it does in every turn, while
// that phase is the highest. A longer calm begins anew: near standstill terminals rest at zero. About 80 clocks.
bool stuck_step(stuck_t *stuck, const int32_t v_q17[3], bool emf, uint32_t limit);

#endif
