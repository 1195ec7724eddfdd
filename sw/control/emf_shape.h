// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Shape of a trapezoidal EMF in the rotor's frame, for a voltage that carries its harmonics instead of the regulator.
//
// There the EMF is (j + s) E, E its fundamental and s what the harmonics 6 n +- 1 of the phases make of it. s repeats six
// times a turn, with an odd d and an even q. A table holds it for 6 theta from 0 to half a turn. theta is the angle in the
// middle of the time in which the voltage acts.
#ifndef FL_EMF_SHAPE_H
#define FL_EMF_SHAPE_H

#include <stdint.h>

#include "control/complex_fixed.h"

#define EMF_SHAPE_POINTS 9

typedef struct {
  int32_t d_q24[EMF_SHAPE_POINTS];
  int32_t q_q24[EMF_SHAPE_POINTS];
  int32_t lead_cycles;     // from the sample to the middle of the action
  int32_t most_turn_q36;   // speed from which on the shape repeats in less than four ticks: there is none
} emf_shape_settings_t;

typedef struct {
  int32_t emf_v_q25;  // E, with the sign of the speed
  uint32_t lead_turn_q32;
  uint32_t rests_mask;  // 1 where it repeats in more than eight ticks: those with an odd number need no new one
} emf_shape_t;

// At a speed. What a shape of an eighth makes of E stays within the room that the voltage has.
void emf_shape_follow(emf_shape_t *shape, const emf_shape_settings_t *settings, int32_t emf_v_q25,
                      int32_t speed_turn_q36, int32_t room_v_q25, int32_t tick_cycles);

// s for a sample's angle. About 50 clocks.
complex_t emf_shape_q24(const emf_shape_t *shape, const emf_shape_settings_t *settings, uint32_t angle_turn_q32);

#endif
