// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Current reference in torque mode: the wanted current between two speed limits.
//
//   i = clamp(i_target, kp (n_low - n), kp (n_high - n)),   n_low < n_high, kp of the speed regulator
//
// Near n_high the current falls to zero and below; near n_low, under which no crossing is seen, it rises. The limits of
// the current itself come last.
#ifndef FL_TORQUE_H
#define FL_TORQUE_H

#include <stdint.h>

#include "control/fixed.h"

// low_i <= high_i. About 90 clocks.
int32_t torque_reference(int32_t target_i_q25, gain_t kp, int32_t speed_rpm_q8, int32_t low_rpm_q8, int32_t high_rpm_q8,
                         int32_t low_i_q25, int32_t high_i_q25);

#endif
