// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Channels of the converter that cannot be right: one that never changes, currents that do not add up to nothing.
//
// A channel that works shows the converter's noise. One whose value is the same for many looks is stuck, whatever it
// shows; a value at either end of the range is left to the limits, because there noise is cut off.
//
// The currents of a machine whose star point is isolated add up to zero. A channel that is stuck or has lost offset or
// gain, or a current to earth, leaves a sum. Looks with a sum beyond the limit count up by 4, others down by 1, since the
// error of a stuck channel vanishes wherever its current passes what it shows.
#ifndef FL_PLAUSIBLE_H
#define FL_PLAUSIBLE_H

#include <stdbool.h>
#include <stdint.h>

#define STILL_CHANNELS_MAX 2u

typedef struct {
  uint16_t last[STILL_CHANNELS_MAX];  // low half of the value
  uint16_t same[STILL_CHANNELS_MAX];  // looks
} still_t;

typedef struct {
  uint32_t count;
} sum_t;

// One look at `channels` values. True: one of them was the same at the last `limit` looks and the one before; limit: at most
// 65535, 0: never. About 12 clocks a channel.
bool still_step(still_t *still, const int32_t values_q17[], uint32_t channels, uint32_t limit);

// One look at the sum of the phase currents; limit_q17 0: never. True: at least 4 looks beyond it, all in a row or more of
// them. About 15 clocks.
bool sum_step(sum_t *sum, int32_t sum_i_q17, int32_t limit_q17);

#endif
