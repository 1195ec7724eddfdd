// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Angle and speed of a coasting rotor from the three terminal voltages at the control ticks, gates off.
//
//   arg = atan2( sqrt(3) (vb - vc), 2 va - vb - vc )       the star point's voltage drops out
//   the EMF leads the magnet by 90 degrees forward (theta = arg - 90), lags by 90 backward (theta = arg + 90)
//   speed = mean step of the angle from tick to tick: unambiguous below half a turn a tick, trusted below a third
//
// The converter shows no negative voltage: of a terminal that reads 0 the voltage is what the network makes of the
// others. With all gates off the terminals sum to zero, until the lower diode of the lowest one holds it at -V_D. Where
// two read 0 both are put at 3/4 V_D: 9 degrees wrong at most at an amplitude of 4 V_D.
//
// Entry: the sector for the angle at the next update event. Its crossing, in its middle, must still be ahead: past
// CATCH_MARGIN of a sector the next one is taken, whose crossing comes at most 75 degrees later. The crossings then
// commutate; no instant depends on the precision of the angle. So long before a sector its pair has as little as a third
// of the EMF that the voltage stands for: with little inductance a multiple of the rated current. An entry waits for the
// beginning of a sector.
#ifndef FL_CATCH_H
#define FL_CATCH_H

#include <stdbool.h>
#include <stdint.h>

// Ticks over which the speed is measured and the steps have to agree.
#define CATCH_TICKS 16u
#define CATCH_SIXTH 715827883u  // 60 degrees
// 15 degrees: as far before the crossing.
#define CATCH_MARGIN 178956971u
// 10 degrees: as far before the sector its pair has 0.8 of its EMF, and the voltage drives no more than rated current.
#define CATCH_EARLY 119304647u

typedef struct {
  uint32_t angle;     // last arg, 2^32 = one turn
  int32_t step;       // last change of it
  int32_t travel;  // sum of the agreeing steps / 64
  uint32_t agreeing;
  uint32_t seen;  // 1: an angle, 2: a step too
} catch_t;

// Angle of a vector, 2^32 = one turn, to 0.1 degrees; components below 2^30. About 150 clocks.
uint32_t vector_angle(int32_t x, int32_t y);

// Terminal voltages as they are from what the converter shows, gates off. Returns their spread, the line EMF; what the
// highest one shows, if none is at zero.
int32_t catch_restore(const int32_t shown_q17[3], int32_t diode_q17, int32_t v_q17[3]);

void catch_reset(catch_t *rotor);

// One tick's voltages, q17. True: CATCH_TICKS steps agree; mean_step is the angle a tick then, negative backward.
bool catch_step(catch_t *rotor, const int32_t v_q17[3], int32_t *mean_step);

// Sector index to enter at an arg of the EMF, for the direction.
uint32_t catch_sector(uint32_t arg, bool backward);

// The angle lies where that sector begins.
bool catch_begins(uint32_t arg, bool backward);

// Length of a sector in clocks at |mean_step| a tick; saturates at 24 bits.
uint32_t catch_sector_cycles(int32_t mean_step, uint32_t tick_cycles);

#endif
