// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// The start: wait for a slow rotor, bootstrap precharge, two alignment vectors, forced ramp, hand-over, lock.
#ifndef FL_START_H
#define FL_START_H

#include "control/handover.h"
#include "control/ramp.h"
#include "drive/coast.h"
#include "drive/six_step/hall.h"
#include "drive/six_step/pwm.h"
#include "drive/six_step/sequence.h"
#include "drive/six_step/view.h"

// Phases in which the gains of the regulators are prepared last at least as long.
#define START_PREPARE_TICKS 8u

typedef struct {
  phase_t phase;
  uint32_t ticks;  // since entry into the phase
  bool reverse;    // direction of the drive
  bool gates;
  coast_t coast;
  uint32_t caught_ticks;  // consecutive, of a rotor that may be caught: waits for the beginning of a sector
  uint32_t pulled_ticks;  // consecutive, while aligning: a load turns the rotor
  handover_t handover;
  uint32_t late_seen;  // count of late crossings at the last tick of the ramp
  ramp_t ramp;
  uint32_t interval_for;  // commutation count for which the forced interval was computed
  uint32_t held_from;  // commutation count at which the hand-over speed was reached; UINT32_MAX before
  uint32_t first_cycles;  // of this attempt's ramp
  int32_t accel_rpm_q20;
  bool ramps;           // the voltage is that of the ramp
  uint32_t lock_ticks;  // of the lock, after the ramp's end
  uint32_t valid_ticks;     // of the lock, in which the gains are prepared for a measured speed
  uint32_t locked_from;     // crossing count at hand-over; edge count at the beginning of a start by Hall
  uint32_t longest_cycles;  // carrier period of a caught rotor until its speed is measured
  int32_t let_go_v_q17;  // EMF below which a rotor is not caught the wrong way; 0: it was not let go to be reversed
  uint32_t catches;         // rotors caught since boot
} start_t;

// Begin to coast; direction from the sign of the target.
void start_begin(start_t *s, hall_t *h, six_step_command_t *command, const parameters_t *p, const settings_t *settings);
void start_off(start_t *s);

// Let a rotor that runs by its edges coast, to prove them; then it is caught.
void start_prove(start_t *s, hall_t *h);

// The rotor is about to be let go, at this EMF, to be started the other way.
void start_let_go(start_t *s, int32_t emf_v_q25);

// One step while starting. EVENT_STARTED when the crossings, or the edges, hold the rotor.
outcome_t start_step(start_t *s, hall_t *h, pwm_t *pwm, six_step_command_t *command, const six_step_view_t *view);

// Phase in which the gains of the regulators are prepared.
bool start_prepares(const start_t *s);

// Patience with a crossing.
uint32_t start_timeout_q12(const start_t *s);

// Longest carrier period that gives enough pulses in a sector.
uint32_t start_longest_cycles(const start_t *s, const measured_t *m);

#endif
