// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Misplacement of Hall sensors: how late the edge into each sector comes, in 1/2^16 of a sector interval (60 degrees).
//
//   equal intervals    late[s] = late[s-1] + t[s] - T/6, mean 0      t[s] ends with the edge into sector s, T their sum
//   against crossings  late[s] = phase[s] - T/12                     phase[s] from the crossing before to that edge
//
// The intervals show how the edges sit to each other, not a lag common to all; the crossings show both.
#ifndef FL_HALL_OFFSET_H
#define FL_HALL_OFFSET_H

#include <stdbool.h>
#include <stdint.h>

#include "control/balance.h"

// 30 degrees: an edge that is later or earlier belongs to another crossing.
#define HALL_LATE_MAX_Q16 32767

// cycles_x6: lateness in clocks, six times too large (interval_lateness). About 150 clocks.
int32_t hall_late_from_intervals_q16(int32_t cycles_x6, uint32_t period_cycles);

// phase_cycles: saturated, or too far from half an interval: HALL_LATE_MAX_Q16 + 1. About 150 clocks.
int32_t hall_late_from_phase_q16(uint32_t phase_cycles, uint32_t period_cycles);

// The same sensors seen in the other direction: the edge into the sector that drives negative speed at the same place
// comes as early as this one is late. to and from may not be the same.
void hall_mirror(const int32_t from[SECTORS], bool to_backward, int32_t to[SECTORS]);

#endif
