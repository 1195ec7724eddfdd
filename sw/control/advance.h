// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Commutation advance that grows with speed and current, for the delay of the current behind its commutation.
#ifndef FL_ADVANCE_H
#define FL_ADVANCE_H

#include <stdint.h>

// Largest magnitude of the whole advance: 30 degrees, Q0.16 of 60 degrees.
#define ADVANCE_MAX_Q16 32767

// at_speed * speed_ratio + at_current * current_ratio; ratios q16 within 0..2. About 60 clocks.
int32_t advance_added_q16(int32_t at_speed_q16, int32_t speed_ratio_q16, int32_t at_current_q16,
                          int32_t current_ratio_q16);

// The sum within its limits.
int32_t advance_total_q16(int32_t base_q16, int32_t added_q16);

#endif
