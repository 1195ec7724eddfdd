// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// The drive: state machine, start, speed control and faults of both methods, six-step and vector. drive_step makes one
// control step per control tick. It turns a snapshot of the chip into a command to the chip.
//
//   init -> ready -> starting -> running -> stopping -> ready;   any -> fault -> init
//
// It knows no register. app/app.c carries snapshot and command to and from the chip, so the same code runs on the soft
// core and in host tests.
//
// Numbers: fixed point, 32 bits. A name ends with its unit and Q format: speed_rpm_q8, advance_q16. Times are in clocks or
// in control ticks. A target is negative backward. A measured speed is a magnitude.
// Latency: a command made from the snapshot of tick n acts at the update event of tick n + 1.
// Errors: a fault_t (drive/faults.h) names the cause. The drive then opens the gates and stays in STATE_FAULT until a clear.
// Equations: docs/architecture.md, section "Firmware". The functions of control/ name their source.
#ifndef FL_DRIVE_H
#define FL_DRIVE_H

#include <stdbool.h>
#include <stdint.h>

#include "control/balance.h"
#include "control/catch.h"
#include "control/complex_regulator.h"
#include "control/csc_linearity.h"
#include "control/emf_observer.h"
#include "control/encoder.h"
#include "control/field_weakening.h"
#include "control/handover.h"
#include "control/if_start.h"
#include "control/limiter.h"
#include "control/overload.h"
#include "control/pi.h"
#include "control/plausible.h"
#include "control/pll.h"
#include "control/ramp.h"
#include "control/regulator_design.h"
#include "control/stuck.h"
#include "control/vector_model.h"
#include "drive/faults.h"
#include "drive/parameters.h"
#include "drive/settings.h"
#include "hal/chip_io.h"

typedef enum { REQUEST_NONE, REQUEST_START, REQUEST_STOP, REQUEST_STOP_NOW, REQUEST_CLEAR } request_t;

// Measured quantities of the last tick.
typedef struct {
  int32_t vdc_v_q25;      // mean over the tick
  int32_t idc_q17;        // DC-link current, mean over the tick, filtered
  int32_t motor_q17;      // sum of the positive phase currents, filtered
  int32_t line_i_q25;     // current of the conducting pair from the DC-link current, filtered
  int32_t line_emf_q17;   // spread of the terminal voltages; the line EMF while the gates are off
  int32_t speed_rpm_q8;   // mechanical, magnitude, mean over the last electrical turn
  bool speed_valid;
  bool speed_fresh;  // measured in this tick
  bool speed_due;    // a crossing has come since
  uint32_t sector_cycles;   // mean crossing interval over the last electrical turn
  uint32_t longest_cycles;  // carrier period that still gives enough pulses in a sector
  uint32_t crossings;     // since the commutation timer was switched on, wraps after days
  uint32_t commutations;  // the same
  uint32_t timer_on_ticks;
  uint32_t last_sample;
  uint32_t silent_ticks;  // consecutive ticks without a sample
  uint8_t timeouts;          // counter of the timer at the last boundary of 64 ticks
  uint8_t timeouts_before;   // and at the one before
  int32_t idc_mean_q17;  // over the tick
  int32_t idc_filter_q25;
  int32_t motor_filter_q25;
  int32_t loop_filter_q25;
} measured_t;

// Gains and limits of the speed control that vary with speed and DC-link voltage.
typedef struct {
  pi_gains_t pi;
  gain_t kp_full;  // without the reduction at low speed
  int32_t resistive_v_q25;  // R * current limit
  int32_t acceleration_v_q25;  // voltage that accelerates with the ramp
  int32_t low_v_q25;  // of the least and of the largest duty
  int32_t high_v_q25;
  int32_t line_ratio_q16;  // current of the conducting pair over DC-link current
  int32_t limit_i_q25;     // the lower one of current limit and DC limit
  int32_t acceleration_i_q25;
  gain_t resistance;     // R(n), i_q25 -> v_q25
  pi_gains_t speed_i;    // speed regulator of the current loop
  pi_gains_t current;    // current regulator
  csc_linearity_t linearity;
  int32_t advance_q16;  // what speed and current add
} scheduled_t;

// Hall sensors. late: how late the edge into each sector comes, for positive [0] and negative [1] speed.
typedef struct {
  bool driving;  // the edges commutate, or will from the start on
  bool faulty;
  bool backward;
  bool learnt[2];
  bool seen;   // the counters below are of the last tick
  bool apart;  // the last edge lay far from where the crossing before it puts it
  uint16_t edges;
  uint8_t invalid;
  uint8_t skipped;
  uint32_t edge_count;     // since boot
  uint32_t still_ticks;    // without an edge
  uint32_t invalid_ticks;  // consecutive, with an invalid code
  uint32_t suspicion;      // rises with invalid codes and skipped sectors, falls with good edges
  uint32_t agreeing;       // edges in a row that crossings agree with
  uint32_t driving_ticks;  // since the edges took over
  uint32_t handovers;      // from crossings to edges, since boot
  uint32_t judged_edges;   // edge_count that was compared with a crossing
  uint32_t stage;
  uint32_t turn_from;      // edge_count when the wait for a turn began
  uint32_t period_cycles;  // of the turn before
  int32_t late_x6[SECTORS];
  int32_t target_q16[SECTORS];
  int32_t late_q20[2][SECTORS];
} hall_t;

// Slow protection.
typedef struct {
  overload_t overload;
  sum_t sum;
  still_t still;
} protect_t;

// What gives the voltage while running.
typedef enum { REGULATOR_VOLTAGE, REGULATOR_CURRENT, REGULATOR_TORQUE } regulator_t;

// Correction B.
typedef struct {
  balance_t balance;
  uint8_t mode;  // BALANCE_NONE.. that the integrators are in
  uint32_t stage;
  bool busy;  // a stage ran in this tick
  uint32_t turn_from;      // crossings when the wait for a turn began
  uint32_t period_cycles;  // of the turn before
  uint8_t late;
  uint8_t timeouts;
  int32_t error_x6[SECTORS];
  gain_t gain;
} thresholds_t;

// Frame of the vector drive.
typedef enum { FRAME_OFF, FRAME_CAUGHT, FRAME_FORCED, FRAME_OBSERVED, FRAME_INJECTED } frame_t;

typedef struct vector_injection vector_injection_t;  // vector_injection.h

// What depends on the speed.
typedef struct {
  regulator_gains_t regulator;
  emf_observer_gains_t observer;
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

// Vector drive (vector.h).
typedef struct {
  // From the parameters.
  vector_plant_t plant;       // of one sample
  vector_plant_t observed;    // the same with L_q, which the observer of a salient machine knows
  const vector_plant_t *regulated;  // that the design under way is for
  bool salient;  // the observer has a model of its own
  uint32_t stages;  // of a design
  vector_machine_t per_tick;  // of the samples of a tick
  regulator_design_t order;
  pll_gains_t pll_gains;
  if_settings_t start_settings;
  pi_gains_t speed_gains;
  gain_t weakening_ki;
  gain_t to_rpm;  // 2^-36 turn a clock -> rpm_q8
  int32_t back_rpm_q8;
  int32_t handover_rpm_q8;
  int32_t least_rpm_q8;
  uint32_t lost_checks;
  bool sensored;  // the frame follows the encoder
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
  int32_t speed_turn_q36;
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
  complex_t state_v_q25;    // of the regulator, at the last check
  pll_t pll;
  uint32_t emf_reciprocal;  // pll_error_from_q30's
  int32_t error_q30;           // that the loop was given
  uint32_t frame_turn_q32;     // angle_turn_q32 and the turn taken since
  uint32_t encoder_turn_q32;   // without offset
  uint32_t encoder_offset_q32;
  encoder_swing_t swing;
  uint16_t encoder_invalid;    // of the last check
  uint32_t encoder_faults;     // lost steps since boot
  int32_t observed_ahead_q30;  // observed rotor ahead of the frame, sine
  int32_t encoder_ahead_q30;   // encoder's rotor ahead of the frame, rad
  if_start_t start;
  uint32_t waiting_ticks;  // for the hand-over, at its speed
  int32_t turn_from_q32;   // of the rotor ahead of the frame, when it began to be steady
  int32_t turn_middle_q32; // half the time later
  pi_state_t speed;
  field_weakening_t weakening;
  int32_t mtpa_i_q25;       // i_d of the most torque
  complex_t reference_i_q25;
  uint32_t suspicion;  // checks in a row that failed
  complex_t current_i_q17;
  uint32_t angle_turn_q32;  // of the frame at the sample
  uint32_t emf_v_q25;
  vector_injection_t *injection;  // 0: none
} vector_t;

typedef struct {
  const parameters_t *p;
  uint64_t speed_numerator_q8;
  settings_t settings;  // the control step only reads them; the console replaces the set as a whole
  bool settings_fresh;  // changed since the control step took them
  request_t request;

  drive_state_t state;
  phase_t phase;
  fault_t fault;
  fault_log_t log;
  uint32_t tick;
  uint32_t state_ticks;  // since entry into the state, or into the phase of a start
  uint32_t calm_ticks;
  uint32_t pulled_ticks;  // consecutive, while aligning: a load turns the rotor
  uint32_t failed_starts;
  bool pulled_out;  // the last start failed because a load turned the rotor: it may be caught again
  bool start_excused;  // an over-current while starting has been taken for a lost lock
  uint32_t restarts;
  uint32_t lost_locks;  // since boot
  volatile uint32_t heard_tick;  // of the console's last line
  bool reverse;

  measured_t m;
  scheduled_t scheduled;
  ramp_t ramp;
  uint32_t schedule_group;  // due next
  bool schedule_skipped;
  regulator_t regulator;
  bool linear;  // settings.linearity that the gains were set for
  pi_state_t speed_pi;
  pi_state_t current_pi;
  int32_t reference_i_q25;
  int32_t saturated;  // the current regulator's voltage was at its upper limit: 1, at its lower one: -1
  limiter_t limiter;
  int32_t brake_i_q25;  // largest braking current now
  catch_t rotor;
  stuck_t stuck;
  uint32_t catches;  // rotors caught since boot
  thresholds_t thresholds;
  hall_t hall;
  vector_t vector;
  handover_t handover;
  uint32_t interval_for;  // commutation count for which the forced interval was computed
  uint32_t held_from;  // commutation count at which the hand-over speed was reached; UINT32_MAX before
  uint32_t first_cycles;         // of this attempt's ramp
  int32_t start_accel_rpm_q20;
  uint32_t outrun_ticks;   // consecutive, while running
  uint32_t locked_from;  // crossing count at hand-over; edge count at the beginning of a start by Hall
  bool was_frozen;
  protect_t protect;

  int32_t u_v_q25;  // mean voltage applied to the conducting pair
  int32_t duty_q30;
  limit_t limit;
  chip_command_t command;
} drive_t;

// Prepare for the first step. fault: result of the boot checks; with a fault the drive stays in init for good.
void drive_init(drive_t *drive, const parameters_t *parameters, fault_t fault);

// One control step: reads the snapshot, leaves what the chip shall do in drive->command.
void drive_step(drive_t *drive, const chip_snapshot_t *in);
// The same with METHOD_VECTOR.
void drive_vector_step(drive_t *drive, const chip_snapshot_t *in);

// Names for people.
const char *drive_state_name(drive_state_t state);
const char *drive_phase_name(phase_t phase);
const char *drive_limit_name(limit_t limit);

// Shared by the parts of the drive.
void drive_init_step(drive_t *drive, const chip_snapshot_t *in);  // current offsets, gates off
bool drive_supervise(drive_t *drive, const chip_snapshot_t *in);  // true: the state has been left
void drive_handle_request(drive_t *drive);
void drive_lost_lock(drive_t *drive);
void drive_renew_attempts(drive_t *drive);  // of restarts and starts: all that the parameters allow
void drive_enter(drive_t *drive, drive_state_t state);
void drive_enter_fault(drive_t *drive, fault_t fault);
void drive_gates_off(drive_t *drive);
void drive_apply_voltage(drive_t *drive, int32_t u_v_q25, bool sync_rect);
void drive_take_crossing(drive_t *drive);  // what finds the crossings, from the settings
// Crossings claim a speed whose EMF is over four times what the applied voltage leaves after the resistive drop: no rotor
// turns like this. On one that stands, what follows the blanking is taken for a crossing, and it and the commutation
// that it causes chase each other. A drive that brakes applies at least half of the EMF, or what its braking current leaves of it.
bool drive_outruns_voltage(const drive_t *drive, int32_t drop_v_q25);
bool drive_turns_wrong(const drive_t *drive);  // the target has the other sign
int32_t drive_target_rpm_q8(const drive_t *drive);  // magnitude within the allowed speeds

#endif
