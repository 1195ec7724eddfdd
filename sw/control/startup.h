// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Open-loop start: which sector follows the alignment, and the intervals of a constant electrical acceleration.
//
// The rotor aligned to leg X (current into X, out of the two others) has its flux on the axis of X: theta = 0, 120,
// 240 degrees. Sector index k drives a field at 330 + 60 k degrees, and is left forward at theta = 270 + 60 k.
// The start sector is the one whose field stands 90 degrees ahead of the aligned rotor; the rotor is then in the
// middle of that sector, so that the first commutation is due after 30 degrees and each next after 60:
//   t_n = t_1 * sqrt(2 n + 1),  n = 0, 1, 2, ...   with t_1 = sqrt(2 * (pi / 6) / acceleration)
#ifndef FL_STARTUP_H
#define FL_STARTUP_H

#include <stdbool.h>
#include <stdint.h>

// Sector index 0..5 to apply to a rotor aligned to leg 0..2.
uint32_t start_sector(uint32_t leg, bool reverse);

// Interval from forced commutation n to n + 1: t_1 * (sqrt(2 n + 3) - sqrt(2 n + 1)), computed without
// cancellation as 2 t_1 / (sqrt(2 n + 3) + sqrt(2 n + 1)), to 1e-3. first_cycles = t_1 < 2^24. About 500 clocks.
uint32_t forced_interval_cycles(uint32_t first_cycles, uint32_t commutation);

#endif
