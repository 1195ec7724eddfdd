// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Braking current that the DC link still takes: it falls linearly to zero as the voltage nears its trip, at once, and
// returns slowly, so that link capacitor and regulator do not swing against each other.
//
//   i = limit * clamp((vdc_full - vdc) / range, 0, 1),   upward by at most limit / 64 a step
#ifndef FL_BRAKE_H
#define FL_BRAKE_H

#include <stdint.h>

#include "control/fixed.h"

// Braking current for this step from that of the last one; limit_i >= 0. About 70 clocks.
int32_t brake_current(int32_t last_i, int32_t limit_i, int32_t vdc_v_q25, int32_t full_v_q25, gain_t one_over_range);

#endif
