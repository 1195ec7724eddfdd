// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// What the EMF's own harmonics make of an observed speed, taken out of the speed regulator's error.
//
// Unequal phases turn the EMF backwards by a per cent or two: its angle swings with twice the electrical frequency. A
// trapezoid's 5th and 7th harmonic, and the dead time's, swing it with six times the frequency, unequal phases of a
// trapezoid with four times. The rotor does not swing, and a regulator that answers makes it. Each harmonic n is an
// amplitude h in a frame that turns n times as fast as the rotor,
//
//   e = error - Re(h c),  h += mu conj(c) e,  left = e (1 - mu / 2),  c = exp(j n theta),  mu = 2 z n omega T,  z = 0.05
//
// (least mean squares: a notch at n omega with a damping of z, Widrow and Stearns, Adaptive Signal Processing, chapter 12).
// Its phase at the regulator's bandwidth w_s is atan(2 z r / (1 - r^2)), r = w_s / n omega: the caller keeps r <= 0.4. A
// harmonic that turns by more than a quarter in a step fades.
#ifndef FL_RIPPLE_H
#define FL_RIPPLE_H

#include <stdint.h>

#include "control/complex_fixed.h"

#define RIPPLE_HARMONICS 3u

enum { RIPPLE_SECOND = 1u, RIPPLE_SECOND_AND_SIXTH = 2u, RIPPLE_ALL = 3u };

typedef struct {
  uint32_t turn_q32;       // of the rotor, electrical
  int32_t speed_turn_q36;  // without the harmonics: angles that swing with them would have a mean
  complex_t swing_turn_q44[RIPPLE_HARMONICS];
} ripple_t;

// The error without its harmonics. error, speed: 2^-36 turn a clock, what is beyond 2^21 of the error is left as it is.
// cycles: clocks since the step before, up to 2^20. harmonics: RIPPLE_*. About 110,
// 170 and 220 clocks.
int32_t ripple_step(ripple_t *ripple, int32_t error_turn_q36, int32_t speed_turn_q36, int32_t cycles,
                    uint32_t harmonics);

#endif
