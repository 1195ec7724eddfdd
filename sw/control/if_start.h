// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Start with a rotating current (I/f), and the way from it to the observed angle and back without a jump.
//
// The current stands on the d axis of a forced frame: it rises with the frame at rest, which aligns the rotor, then the
// frame turns faster and faster. Under load the rotor falls behind the current by up to 90 degrees. The EMF observer
// works in the forced frame all the while; in it the EMF tells how far the rotor's d axis stands ahead of the frame's:
//
//   turn = arg(e^) - sgn(omega) 90 degrees
//
// The rotor swings about the current like a pendulum, which nothing but friction damps. Across the current stands
// psi omega_rotor cos x of its EMF, x its angle ahead of the frame, also at rest and whichever way it lies. A current across
// damps it by cos^2 x, and turns the other one toward a rotor that falls behind:
//
//   i_q = -k (e^_q - psi omega),   |i_q| <= 0.4 i_d
//
// How far behind it is shows in e^_q / (psi omega) = cos x: the frame accelerates with what is left of the torque, without
// the inertia: fully from cos x = 0.85 on, not below 0.5. No acceleration pulls a rotor out of step then.
//
// A rotor that rests opposite to the current feels no torque. So the current stands on -q at the beginning of the
// alignment: opposite to one of the two is not opposite to the other.
//
// Hand-over: frame, regulator and observer are turned by it (angle + turn, vectors times exp(-j turn)), the speed loop
// is preset with the i_q that results, i_d then fades. Nothing jumps in the phases. Way back, with i_d
// large enough for the rotor to be held: the frame is turned by arg(i), so that the current lies on its d axis again.
#ifndef FL_IF_START_H
#define FL_IF_START_H

#include <stdbool.h>
#include <stdint.h>

#include "control/complex_fixed.h"
#include "control/fixed.h"

typedef struct {
  int32_t current_i_q25;          // amplitude, > 0
  int32_t rise_i_q25;             // its change a tick, > 0
  uint32_t align_ticks;           // at rest with the whole current
  int32_t acceleration_turn_q44;  // change of the speed a tick, > 0
  uint32_t turned_ticks;          // of those, with the current on -q
  gain_t damping;                 // EMF across the current -> current there
  int32_t smooth_q16;             // share a tick of the low pass before it, and before the angle
  uint32_t minimum_v_q25;         // EMF from which the observer counts
  int32_t tolerance_turn_q32;     // the rotor's angle in the frame, beside what it was when it began to be steady
  uint32_t steady_ticks;          // so many ticks within it, for the hand-over
} if_settings_t;

#define IF_WHOLE_Q16 65536

typedef struct {
  int64_t speed_turn_q44;
  int32_t current_i_q25;
  int32_t damping_i_q25;  // across it
  int32_t share_q16;      // of the acceleration, 0..1: the caller follows the load angle with it
  complex_t emf_v_q25;    // smoothed
  uint32_t aligned_ticks;
  int32_t turn_q32;        // the rotor ahead of the frame
  int32_t turn_from_q32;   // when it began to be steady
  int32_t turn_middle_q32; // half the time later
  uint32_t steady_ticks;
} if_start_t;

// Begin at rest without current.
void if_begin(if_start_t *state);

// Come from the observed angle: running, with the amplitude of the present current. due: EMF of the speed.
void if_resume(if_start_t *state, const if_settings_t *settings, int32_t speed_turn_q36, uint32_t amplitude_i_q25,
               int32_t due_v_q25);

// One tick toward a speed of either sign. True: speed and current are there.
// About 80 clocks.
bool if_step(if_start_t *state, const if_settings_t *settings, int32_t target_turn_q36);

// One tick after if_step with the EMF observed in the frame: low pass, damping; the current. due: EMF of the frame's speed,
// signed.
complex_t if_current_i_q25(if_start_t *state, const if_settings_t *settings, complex_t emf_v_q25, int32_t due_v_q25);

// Share of the acceleration for the smoothed EMF beside a due one > 0, both in the frame's direction, q16: 0..1.
int32_t if_share_q16(int32_t emf_v_q25, uint32_t due_v_q25);

int32_t if_speed_turn_q36(const if_start_t *state);

// One tick after if_current_i_q25. True: state->turn_q32 is steady, within 90 degrees, and may be handed over. About 840
// clocks.
bool if_ready(if_start_t *state, const if_settings_t *settings);

// How far the frame has to turn for the current to lie on its d axis. About 400 clocks.
int32_t if_turn_back_q32(complex_t current_i_q25);

// From one value toward another by at most step >= 0 a tick: for i_d after the hand-over and before the way back.
int32_t fade(int32_t from, int32_t to, int32_t step);

#endif
