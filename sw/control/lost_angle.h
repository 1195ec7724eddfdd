// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Is the angle of the frame that follows the EMF still the rotor's? No check trusts the estimate alone. With E the EMF that
// belongs to the estimated speed, e^ the observed one, i the current, T the voltage that the observer may be wrong by:
//
//   T = r |i| + T_0                                    r: share of the resistance; T_0: dead time and noise
//   amplitude   |e^| < E / 2  or  |e^| > 2 E           the machine does not turn at this speed
//   angle       |eps| > 1/2                            30 degrees on the d axis
//   power       s Re(e^ i*) < 0.765 E |i_q| - T |i|    s = sgn(omega i_q); for |i| above a tenth of the rated current.
//                                                      No inductance enters it: j omega L i carries no power
//   blind       T > 0.45 E                             too slow for the current of now: the EMF tells nothing
//   slow        the speed is below `least`, or against the direction of the frame
//
// Stalled: hardly any EMF is left. Contradicted: one of the first three. Else overhauled, against the frame, or stalled.
//
// A leaky count: each check adds or takes the time since the last one, blind alone adds a quarter of it. The angle is lost
// above 5 ms, that is after 5 ms of contradiction or 20 ms of blindness.
#ifndef FL_LOST_ANGLE_H
#define FL_LOST_ANGLE_H

#include <stdbool.h>
#include <stdint.h>

#include "control/complex_fixed.h"
#include "control/fixed.h"

typedef enum { ANGLE_HELD, ANGLE_CONTRADICTED, ANGLE_STALLED, ANGLE_OVERHAULED } angle_verdict_t;

typedef struct {
  gain_t resistance;        // r: current q25 -> v_q25
  uint32_t floor_v_q25;     // T_0
  uint32_t current_i_q25;   // of the power, a tenth of the rated one
  int32_t least_turn_q36;   // speed
  uint32_t most;            // checks' count of 5 ms, four a check
} lost_angle_settings_t;

// In the frame at one instant.
typedef struct {
  complex_t emf_v_q25;
  uint32_t amplitude_v_q25;  // |e^|
  uint32_t expected_v_q25;   // E
  complex_t current_i_q17;
  int32_t error_q30;       // eps
  int32_t speed_turn_q36;  // in the direction of the frame
  bool backward;           // the speed, in the machine
} lost_angle_input_t;

// One check. Anything but held: for longer than is permitted, the count begins anew. About 90 clocks.
angle_verdict_t lost_angle_step(uint32_t *count, const lost_angle_settings_t *settings, const lost_angle_input_t *in);

#endif
