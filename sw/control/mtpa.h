// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Most torque a current: split of a current amplitude into i_d and i_q for a salient machine.
//
//   T ~ i_q (psi - (L_q - L_d) i_d),   k = psi / (L_q - L_d)
//   i_d = (k - sqrt(k^2 + 8 i^2)) / 4 = -2 i^2 / (k + sqrt(k^2 + 8 i^2)),   i_q = +-sqrt(i^2 - i_d^2)
//
// k < 0 (L_d > L_q): i_d of the other sign.
#ifndef FL_MTPA_H
#define FL_MTPA_H

#include <stdint.h>

#include "control/complex_fixed.h"

// Currents for a signed amplitude |i| <= 2^25; ratio k with |k| <= 2^30 (32 full scales), 0: not salient, all of it is
// i_q. Parts within two units. About 920 clocks.
complex_t mtpa_current_i_q25(int32_t amplitude_i_q25, int32_t ratio_i_q25);

#endif
