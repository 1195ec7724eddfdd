// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// The vector drive held by injection (injection_frame.h): angle and speed from standstill on, the currents of both subspaces.
// Its frame is the third one beside forced and observed:
//
//   starting: coast, search for the rotor at rest -> running: injected, both directions -> stopping: to standstill,
//   gates off
//
// With a speed of hand-over the EMF observer takes over above it and the wave is switched off; below 0.6 of it the wave
// is there again (injection_handover.h). With the wave the EMF goes forward to the regulator, without it the regulator's
// state has it, which the voltage circle bounds.
//
// An open phase (open_phase.h) at speed, without a wave: of five the others go on, with the fundamental's current as it was
// up to 0.68 of the limit; the regulators of subspace 3 leave it to what the open phase forces. Elsewhere, and with a second
// one, the drive stops: open_phase.c.
//
// What the chip measured at sample k belongs to the frame before the tick. The set committed in step k acts at tick k + 1.
// With the separator the regulators of subspace 1 run at every second sample while there is a wave: their model is that of
// two periods then. Its result, complete with a zero crossing of the HF current, is used a step later: what follows from it then acts at the next zero
// crossing. A speed that changes at a peak in between lets the fundamental into the HF current of that peak, at rated
// current five times what an error of the angle gives.
#ifndef FL_VECTOR_INJECTED_H
#define FL_VECTOR_INJECTED_H

#include "control/injection_frame.h"
#include "control/complex_regulator.h"
#include "control/open_phase.h"
#include "control/ramp.h"
#include "drive/method.h"

#define WAVE_SAMPLES 4u  // a period of the separator's wave

typedef struct vector vector_t;

typedef struct {
  injection_frame_settings_t settings;
  injection_frame_t frame;
  injection_frame_command_t command;
  uint16_t results;     // of the chip, the last that were seen
  uint32_t left_out;    // results of a wave that has just begun
  bool arrived;         // separator: a result in the step before
  bool begun;           // once before
  bool injecting;       // as the chip was told
  bool wanted;          // the frame wants a wave
  ramp_t ramp;
  uint32_t suspicion;   // looks in a row at which the EMF, which alone holds the frame, did not belong to it
  uint32_t contradicted;  // looks at which the voltage denied the angle, less those at which it did not
  uint32_t settling;      // looks until the loop's speed counts
  uint32_t proven;        // looks at which it confirmed it, less those at which it was too small to tell
  uint32_t telling;       // looks in a row at which the EMF tells the pole
  uint32_t unproven;      // from 1 on: the pole is in doubt; looks that the EMF has left to tell it
  int32_t backward_q32;   // by which the rotor has gone against a current that drives it
  uint32_t standing;      // looks at which the rotor stood though it was to turn
  bool observing;       // the EMF observer runs
  bool forward;         // the EMF goes forward, else the regulator's state has it
  uint32_t taken_in;    // steps until the preset state is there
  complex_t state_v_q25[WAVE_SAMPLES];  // shares of the regulator's last states in their mean
  complex_t mean_v_q25;
  complex_t forward_v_q25;  // EMF in the frame
  vector_plant_t single;    // subspace 1, of one sample; with the separator
  vector_plant_t third;      // subspace 3, of one sample
  regulator_gains_t third_gains;
  open_phase_t open;
} vector_injection_t;

// With an injection in the parameters: its settings, for this machine.
void vector_injection_init(vector_t *v, const vector_machine_t *machine);

// The rotor is at rest: switch on and search.
outcome_t vector_injection_begin(vector_t *v);

// Wave and second subspace off.
void vector_injection_off(vector_t *v);

// One control step; about 3000 clocks with I/Q sums, 3500 with the EMF observer.
outcome_t vector_injection_step(vector_t *v, const chip_snapshot_t *in);

// A step of the search: takes the phase currents under its two waves.
void vector_open_phase_listen(vector_t *v, const chip_snapshot_t *in);

// Looks for open phases.
outcome_t vector_open_phase_step(vector_t *v, const chip_snapshot_t *in);

// A start with a phase known as open is refused, once.
outcome_t vector_open_phase_refuses(vector_t *v);

// Current limit with the phases there are.
int32_t vector_open_phase_limit_i_q25(const vector_t *v);

// What the wave leaves of the voltage circle.
uint32_t vector_injection_circle(const vector_t *v, uint32_t circle_v_q17);

// What others may know of it.
void vector_injection_report(vector_t *v);

// Sets of both subspaces, forward voltage and wave into the command.
void vector_injection_command(vector_t *v);

#endif
