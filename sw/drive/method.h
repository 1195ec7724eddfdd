// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// What the drive and a method of driving say to each other. Neither sees the other's record.
//
// A method is given an order and returns an outcome; it never calls upward. What console, CAN, telemetry and protection
// may know of it stands in its report.
#ifndef FL_METHOD_H
#define FL_METHOD_H

#include <stdbool.h>
#include <stdint.h>

#include "drive/faults.h"
#include "drive/parameters.h"
#include "drive/settings.h"
#include "drive/wiring.h"
#include "hal/chip_io.h"

// Time constant of the currents that are shown and limited: 2^3 ticks.
#define CURRENT_FILTER_SHIFT 3
#define TRIPS_OF_CURRENT (TRIP_PHASE_CURRENT | TRIP_DC_CURRENT)

// What has happened. The drive's table says what follows from it in which state.
typedef enum {
  EVENT_STAY,
  EVENT_OFFSETS_KNOWN,  // the currents' offsets are measured
  EVENT_START,          // requests
  EVENT_STOP,
  EVENT_STOP_NOW,
  EVENT_CLEAR,
  EVENT_STARTED,      // the rotor is held: regulation may begin
  EVENT_STOPPED,      // the rotor is slow enough to open the gates
  EVENT_REVERSE,      // the same, on the way to the other direction
  EVENT_HANDED_BACK,  // the start leads the rotor again, through zero
  EVENT_LOCK_LOST,
  EVENT_LOCK_SAVED,    // lost, but the sensors hold the rotor
  EVENT_LOCK_NEVER,    // soon after a start: there has been no lock
  EVENT_START_FAILED,  // this attempt
  EVENT_PULLED_OUT,    // the same: a load turned the rotor, it may be caught
  EVENT_FAULTED,
  EVENT_COUNT,
} event_t;

// Returned, never called upward: an event, with EVENT_FAULTED the fault, with what starts again the cause, and a fault that
// is ridden through. Cause and what is ridden through stand in the log; the cause is the fault where no attempt is left.
// 0: nothing has happened.
typedef uint32_t outcome_t;

static inline outcome_t outcome_of(event_t event) { return (outcome_t)event; }
static inline outcome_t outcome_fault(fault_t fault) { return (outcome_t)EVENT_FAULTED | (outcome_t)fault << 8; }
static inline outcome_t outcome_because(event_t event, fault_t cause) { return (outcome_t)event | (outcome_t)cause << 8; }
static inline outcome_t outcome_passing(outcome_t outcome, fault_t fault) { return outcome | (outcome_t)fault << 16; }
static inline event_t outcome_event(outcome_t outcome) { return (event_t)(outcome & 0xFFu); }
static inline fault_t outcome_fault_of(outcome_t outcome) { return (fault_t)(outcome >> 8 & 0xFFu); }
static inline fault_t outcome_passed(outcome_t outcome) { return (fault_t)(outcome >> 16); }

// What the drive wants. The method only reads it.
typedef struct {
  drive_state_t state;
  uint32_t tick;
  uint32_t state_ticks;  // since entry into the state
  uint32_t failed_starts;
  uint32_t restarts;
  bool again;       // this start follows a failed one or a lost lock
  bool requested;   // this start was asked for
  bool suspected;   // there was an over-current: the winding may be shorted
  bool pulled_out;  // the last start failed because a load turned the rotor: it may be caught again
  bool settings_fresh;  // changed since the step before
} order_t;

static inline bool order_active(const order_t *order) {
  return order->state == STATE_STARTING || order->state == STATE_RUNNING || order->state == STATE_STOPPING;
}

// Of the six-step drive only. The arrays are its own.
typedef struct {
  uint32_t commutations;  // since the commutation timer was switched on
  uint32_t sector_cycles;  // mean crossing interval over the last electrical turn
  int32_t reference_i_q25;
  const int32_t *threshold_q17;  // [SECTORS]
  const int32_t *hall_late_q20;  // [SECTORS] in the present direction
  uint32_t hall_handovers;       // from crossings to edges, since boot
  uint8_t commutated_by;         // commutation_mode_t
  bool hall_faulty;
} six_step_report_t;

// Of the vector drive only.
typedef struct {
  uint32_t angle_turn_q32;  // of the frame at the sample
  int32_t speed_turn_q36;
  complex_t current_i_q17;
  uint32_t emf_v_q25;
  int32_t observed_ahead_q30;  // observed rotor ahead of the frame, sine
  int32_t encoder_ahead_q30;   // encoder's rotor ahead of the frame, rad
  uint32_t encoder_faults;     // lost steps since boot
  uint32_t published_q32;      // by which the published angle is ahead of the frame's
  uint32_t open_phases;        // a bit each
  uint32_t injection_q16[4];   // share of the current, noise, ratio of the inductances, share of the EMF
  bool injects;                // there is an injection
} vector_report_t;

// All that others may know of a method. Its record keeps it.
typedef struct {
  int32_t speed_rpm_q8;   // mechanical; a magnitude with `backward`, else signed
  int32_t demand_rpm_q8;  // the same of the ramp
  int32_t current_i_q25;  // of the conducting pair; i_q
  int32_t vdc_v_q25;
  int32_t idc_q17;
  int32_t idc_mean_q17;   // over the tick
  int32_t motor_q17;      // magnitude of the machine's current, filtered
  int32_t machine_i_q17;  // the same, at a look of the protection
  int32_t voltage_v_q25;
  int32_t duty_q30;
  uint32_t period_cycles;
  uint32_t crossings;
  uint32_t catches;  // rotors caught since boot
  uint32_t silent_ticks;  // consecutive ticks without a sample, in six-step operation with less than half of them
  phase_t phase;
  limit_t limit;
  bool gates;       // the legs may switch
  bool backward;
  bool speed_unknown;  // speed_rpm_q8 is 0 then
  bool impossible;  // no rotor turns at the measured speed
  bool over;        // beyond the permitted speed
  bool doubtful;    // the sensors that commutate have given wrong codes; the frame's angle, before a trip
  const wiring_t *wiring;  // test of the wiring; 0: the method has none
  six_step_report_t six_step;
  vector_report_t vector;
} report_t;

// A method METHOD (six_step, vector) has a record METHOD_t and
//
//   METHOD_init      the record from the parameters
//   METHOD_measure   the snapshot's quantities into the report; true: there is something that supervision must look at
//   METHOD_step      control; returns an outcome
//   METHOD_finish    after the outcome was followed: what the chip is to do, what others may know
//   METHOD_start     begin to coast
//   METHOD_off       legs, regulators, injection off
//   METHOD_explains  whether an over-current now is the consequence of a lost lock
//
// drive.c is the only caller of these. An image links the methods that it holds.

#endif
