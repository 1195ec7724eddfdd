// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Vector drive: I/f start, EMF observer and phase-locked loop, speed regulator, field weakening, reversal, stop.
//
// Two frames: in the forced one the current stands on d and turns as the start wants it; in the observed one d is the
// rotor's. Between them frame, observer and regulator are turned by the same angle, and nothing jumps in the phases:
//
//   starting: coast, a rotor that turns fast enough is caught -> running: observed
//   starting: align, ramp, hand-over -> running: observed -> slower than the way back with the target's sign turned:
//   starting: ramp through zero, hand-over -> running;   stopping: observed, forced down to zero, gates off
//
// Sensored, the frame follows the encoder instead of the EMF: from the alignment, at which the mounting is learnt where no
// index has told it, the observed frame is there at every speed, and nothing is handed back.
//
// Order at tick k: what the chip measured at sample k belongs to the frame before the tick, in which the set committed in
// step k - 1 took effect. So the observer is stepped first and then turned by the correction of that set; the error
// seen then counts every correction made, and the next one, committed now, takes effect at tick k + 1.
//
// Regulator gains and observer gains follow the speed by vector_design, 300 times a second outside of the control step.
// What may be slow goes in turns, every VECTOR_GROUPS ticks: speed regulator, field weakening, limits, supervision.
#ifndef FL_VECTOR_H
#define FL_VECTOR_H

#include "drive/drive.h"

#define VECTOR_GROUPS 4u
#define VECTOR_STAGES 3u  // of a design, one more with two subspaces
#define VECTOR_DESIGNS 4u  // between two of what follows the current instead of the speed

static inline bool vector_injects(const drive_t *drive) {
  return (HELD & HELD_INJECTION) != 0 && drive->vector.injection != 0;
}
static inline bool vector_frame_is_injected(const drive_t *drive) {
  return (HELD & HELD_INJECTION) != 0 && drive->vector.frame == FRAME_INJECTED;
}

// Constants from the parameters, gains for standstill. With METHOD_VECTOR only.
void vector_init(drive_t *drive);

// One stage of a design for the present speed into the spare set, unless one still waits to be taken: deferred
// interrupt. About 2000 clocks, 2800 with a salient machine: with the control steps in between short enough for the UART to wait.
void vector_design(drive_t *drive);

// One control step in place of that of the six-step drive.
void vector_drive_step(drive_t *drive, const chip_snapshot_t *in);

// The current regulator in C, with the set that the chip has in use: the voltage before the limit for the current of a
// sample, then the state for the next one.
complex_t vector_want(drive_t *drive, complex_t current_i_q17);
void vector_bound(drive_t *drive, complex_t wanted_v_q25);

// A coasting rotor turns by mean_step_q32 a tick, the EMF at angle_q32 now: the frame goes along with it, the gates follow
// when the regulator's voltage is the EMF. False: slower than the hand-over, or
// the encoder starts it.
bool vector_catch(drive_t *drive, uint32_t angle_q32, int32_t mean_step_q32);

// The rotor is slow enough after the coast: switch on and align.
void vector_begin(drive_t *drive);

// By which the published angle is ahead of the frame's: cross-coupling and what the angle sequence leaves. 2^32 = one turn.
uint32_t vector_published_q32(const drive_t *drive);

// Legs, regulator and frame off.
void vector_off(drive_t *drive);

#endif
