// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Counts crossings that agree with the forced commutation: the test for handing it over to the crossings.
//
// A crossing is plausible when its interval lies within a tolerance of the forced interval. Clean crossings are not
// late either; late ones mean that the rotor leads the forced field by more than 30 degrees, from where the crossing
// loop still catches it.
#ifndef FL_HANDOVER_H
#define FL_HANDOVER_H

#include <stdbool.h>
#include <stdint.h>

typedef struct {
  uint16_t crossings;  // counter values at the last step
  uint8_t late;
  uint16_t clean;      // consecutive plausible crossings that were not late, saturates
  uint16_t plausible;  // consecutive plausible crossings, late or not, saturates
} handover_t;

// Start counting from the counters as they are now.
void handover_reset(handover_t *handover, uint16_t crossings, uint8_t late);

// Account for the crossings since the last step. tolerance_q16 of the forced interval.
void handover_step(handover_t *handover, uint16_t crossings, uint8_t late, uint32_t interval_cycles,
                   uint32_t forced_cycles, uint32_t tolerance_q16);

#endif
