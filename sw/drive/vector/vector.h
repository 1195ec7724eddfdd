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
// index has told it, the observed frame is there at every speed, and nothing is handed back. Until an EMF has agreed with
// the encoder, the aligned rotor is first led up to half a turn further: an encoder that counts the other way is wrong.
//
// Order at tick k: what the chip measured at sample k belongs to the frame before the tick, in which the set committed in
// step k - 1 took effect. So the observer is stepped first and then turned by the correction of that set; the error
// seen then counts every correction made, and the next one, committed now, takes effect at tick k + 1.
//
// Regulator gains and observer gains follow the speed by vector_design, 300 times a second outside of the control step.
// What may be slow goes in turns, every VECTOR_GROUPS ticks: speed regulator, field weakening, limits, supervision. With
// injection a tick whose set has not been taken keeps its turn, else a step that is late every second time would leave out
// the same turns for ever.
#ifndef FL_VECTOR_H
#define FL_VECTOR_H

#include "control/complex_fixed.h"
#include "control/complex_regulator.h"
#include "control/emf_observer.h"
#include "control/emf_shape.h"
#include "control/encoder.h"
#include "control/field_weakening.h"
#include "control/if_start.h"
#include "control/lost_angle.h"
#include "control/pi.h"
#include "control/pll.h"
#include "control/ramp.h"
#include "control/regulator_design.h"
#include "control/ripple.h"
#include "control/vector_model.h"
#include "drive/coast.h"
#include "drive/method.h"
#include "drive/vector/injected.h"

#define VECTOR_GROUPS 4u
#define VECTOR_STAGES 3u  // of a design, one more with two subspaces
#define VECTOR_DESIGNS 4u  // between two of what follows the current instead of the speed

// Frame of the vector drive. Caught: held at a voltage, which is the EMF, or the pulses of a check.
typedef enum { FRAME_OFF, FRAME_CAUGHT, FRAME_FORCED, FRAME_OBSERVED, FRAME_INJECTED } frame_t;

// What depends on the speed.
typedef struct {
  regulator_gains_t regulator;
  emf_observer_gains_t observer;
  int32_t speed_turn_q36;  // that they are for
} vector_design_t;

// What the current regulator in C works with.
typedef struct {
  regulator_gains_t gains;
  complex_t reference_i_q17;
  complex_t preset_v_q25;
  int32_t limit_v_q17;
  bool regulate;
} direct_set_t;

// 1 / count, kept.
typedef struct {
  uint32_t count;
  int32_t share_q30;
} share_t;

// Limit of i_q beside an i_d, kept.
typedef struct {
  int32_t limit_i_q25;
  int32_t d_i_q25;
  int32_t rest_i_q25;
} current_rest_t;

// Memory of the measuring.
typedef struct {
  int32_t idc_filter_q25;
  uint32_t last_sample;
} vector_measured_t;

// Of the ramp, renewed with its slope and its end.
typedef struct {
  int32_t step_rpm_q20;  // a tick
  int32_t target_rpm_q8;
  int32_t ahead_i_q25;   // current that accelerates so
  int32_t soft_rpm_q8;   // so far from its end it slows down
  gain_t approach;       // what is left -> step_rpm_q20
} slope_t;

typedef struct vector {
  const parameters_t *p;
  const settings_t *settings;
  const order_t *order;
  uint64_t speed_numerator_q8;
  vector_measured_t m;
  coast_t coast;
  ramp_t ramp;
  int32_t brake_i_q25;  // largest braking current now
  bool whole;  // this tick has read everything
  report_t report;
  vector_command_t command;

  // From the parameters.
  vector_plant_t plant;       // of one sample
  vector_plant_t observed;    // the same with L_q, which the observer of a salient machine knows
  const vector_plant_t *regulated;  // that the design under way is for
  bool salient;  // the observer has a model of its own
  uint32_t stages;  // of a design
  vector_machine_t per_tick;  // of the samples of a tick
  int32_t drift_rad_q32;        // turn in a tick by a speed of 2^-36 turn a clock
  int32_t drift_most_turn_q36;  // speed by which the frame turns 2^-4 rad in a tick
  pll_gains_t pll_gains;
  if_settings_t start_settings;
  pi_gains_t speed_gains;
  gain_t weakening_ki;
  gain_t to_rpm;  // 2^-36 turn a clock -> rpm_q8
  int32_t back_rpm_q8;
  int32_t handover_rpm_q8;
  int32_t least_rpm_q8;
  lost_angle_settings_t lost;
  uint32_t lost_checks;
  bool sensored;  // the frame follows the encoder
  bool encoder;   // there is one
  bool several;   // samples a tick
  bool on_core;   // the current regulator is the one in C
  bool shaped;    // harmonics of the EMF go forward
  bool forwards;  // they, or an injection's EMF
  encoder_settings_t encoder_settings;

  // Background design: `used` changes in the control step only, where a finished one waits.
  vector_design_t design[2];
  vector_model_t model;
  uint32_t stage;
  bool fits;
  uint32_t used;
  volatile bool finished;
  bool design_waits;        // a finished one is taken by the injection, with the wave

  // Current regulator in C: `used` changes where the chip has taken the set of the step before, the other one is written.
  direct_set_t direct[2];
  volatile uint32_t direct_used;
  complex_regulator_t regulator;

  frame_t frame;
  int32_t direction;  // of the observed frame: +1, -1
  int32_t goal_i_q25;  // that i_d goes to
  int32_t correct_q32;      // turn of the frame that has been written and not taken yet
  bool holding;             // the regulator's state is held at its preset for a tick
  emf_observer_t observer;
  current_rest_t rest;
  uint32_t band_i_q17;         // currents up to it get no dead-time compensation
  uint32_t zone_i_q17;         // beyond it, in which the compensation grows to the whole
  complex_t late_v_q25;     // of the dead time's compensation, as it acts, less what the dead time takes
  share_t steps;            // regulator steps a tick
  share_t sums;             // samples in the sums of the DC link
  complex_t forward_v_q17;  // of the last regulator step: the set before the one that the chip has taken
  emf_shape_t shape;
  complex_t state_v_q25;    // of the regulator, at the last check
  pll_t pll;
  uint32_t emf_reciprocal;  // pll_error_from_q30's
  int32_t error_q30;           // that the loop was given
  uint32_t frame_turn_q32;     // angle_turn_q32 and the turn taken since
  uint32_t encoder_turn_q32;   // without offset
  uint32_t encoder_offset_q32;
  encoder_swing_t swing;
  uint32_t proof_turn_q32;     // of the frame, at the end of the alignment, or of the coasting rotor, when the proof began
  bool proving;                // while coasting
  uint16_t encoder_invalid;    // of the last check
  uint16_t encoder_strayed;    // the same
  if_start_t start;
  uint32_t waiting_ticks;  // for the hand-over, at its speed
  uint32_t slip_checks;    // in a row in which the rotor did not follow the forced frame
  uint32_t slip_turn_q32;  // of the frame meanwhile
  pi_state_t speed;
  ripple_t ripple;
  slope_t slope;
  int32_t ahead_most_i_q25;  // largest current that accelerates, since the hand-over
  field_weakening_t weakening;
  int32_t mtpa_i_q25;       // i_d of the most torque
  complex_t reference_i_q25;
  uint32_t suspicion;  // lost_angle_step's count
  // What speaks against the encoder.
  uint32_t contradictions;  // checks in a row that found a turning rotor where it stands, or leaps of it
  uint32_t astray;          // checks that found the EMF elsewhere than the encoder, four each, less those that did not
  uint32_t still;           // checks at a large current that found the rotor held, two each, less the others
  int32_t fastest_rpm_q8;   // before them, in the current's direction
  uint32_t strays;          // in a row, of the index to another position
  uint32_t stray_tick;      // last one
  int32_t stray_q30;        // jump of the angle there
  int32_t calm_turn_q36;    // speed before it
  bool stray_waits;         // for its second look
  bool indexed;             // the index has come
  bool learnt;              // an alignment has told the mounting
  bool index_jumped;        // more than 45 degrees from the angle of the alignment
  bool encoder_right;       // the EMF has agreed with it
  wiring_t wiring;
  uint32_t late_ticks;            // with injection: whose set was not taken, their turn comes again
  bool late;                      // this one
  bool tests;                     // the wiring: every snapshot shall have the phase currents
  vector_injection_t *injection;  // 0: none
} vector_t;


// The slow protection is for the core's load slower than the groups.
#define VECTOR_LOOK_TICKS (16u * VECTOR_GROUPS)
#define VECTOR_LOOK_AT 3u  // the group of the supervision

// The tick by which what may be slow has its turn.
static inline uint32_t vector_turn_tick(const vector_t *v, const order_t *order) {
  return ((HELD & HELD_INJECTION) != 0) ? order->tick - v->late_ticks : order->tick;
}

// The record from the parameters; order and settings: where they will be.
void vector_init(vector_t *v, const parameters_t *p, const order_t *order, const settings_t *settings);

// The snapshot's quantities into the report. True: there is something that supervision must look at.
bool vector_measure(vector_t *v, const chip_snapshot_t *in, const order_t *order, const settings_t *settings);
// Control.
outcome_t vector_step(vector_t *v, const chip_snapshot_t *in, const order_t *order, const settings_t *settings);
// After the outcome was followed: what the chip is to do, what others may know.
void vector_finish(vector_t *v, const order_t *order);

// Whether an over-current now is the consequence of a lost lock.
bool vector_explains(const vector_t *v, const chip_snapshot_t *in, const order_t *order);
// Begin to coast.
void vector_start(vector_t *v, const order_t *order, const settings_t *settings);
// Legs, regulators, injection off.
void vector_off(vector_t *v);

// One stage of a design for the present speed into the spare set, unless one still waits to be taken: deferred
// interrupt. About 2000 clocks, 2800 with a salient machine: with the control steps in between short enough for the UART to wait.
void vector_design(vector_t *v);

// The current regulator in C, with the set that the chip has in use: the voltage before the limit for the current of a
// sample, then the state for the next one.
complex_t vector_want(vector_t *v, complex_t current_i_q17);
void vector_bound(vector_t *v, complex_t wanted_v_q25);

#endif
