// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// The drive: state machine, requests and faults of both methods, six-step and vector. drive_step makes one control step
// per control tick. It hands a snapshot of the chip to the method (method.h) and follows the outcome that the method returns.
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

#include "drive/faults.h"
#include "drive/method.h"
#include "drive/parameters.h"
#include "drive/protect.h"
#include "drive/settings.h"
#include "drive/six_step/six_step.h"
#include "drive/supervise.h"
#include "drive/vector/vector.h"

typedef enum { REQUEST_NONE, REQUEST_START, REQUEST_STOP, REQUEST_STOP_NOW, REQUEST_CLEAR } request_t;

typedef struct {
  const parameters_t *p;
  // What the console and the bus have left; the control step takes it.
  settings_t settings;
  bool settings_fresh;  // changed since the control step took them
  request_t request;
  volatile uint32_t heard_tick;  // of the last line of the console or command of a master

  order_t order;
  fault_t fault;
  fault_log_t log;
  uint32_t lost_locks;  // since boot
  phase_t failed_phase;  // in which the last failed attempt at a start ended
  supervise_t supervise;
  protect_t protect;
  guard_command_t guard;
  const report_t *report;  // of the method
  union {  // by the parameters' method
    six_step_t six_step;
    vector_t vector;
  } method;
} drive_t;

// Prepare for the first step. fault: result of the boot checks; with a fault the drive stays in init for good.
void drive_init(drive_t *drive, const parameters_t *parameters, fault_t fault);

// One control step: reads the snapshot, leaves what the chip shall do in drive->guard and in the method's command.
void drive_step(drive_t *drive, const chip_snapshot_t *in);
// Between two steps: the fault that somebody else has found, with the gates off from the next step on.
void drive_fail(drive_t *drive, fault_t fault);
// The same of a drive that the boot checks have refused: it counts the ticks.
void drive_wait(drive_t *drive);
// The same with METHOD_VECTOR.
void drive_vector_step(drive_t *drive, const chip_snapshot_t *in);

// What console and bus leave for the next control step, which must not come in between: a request, all settings, or what a
// node on the bus orders of them (target and its line, acceleration, current limit, mode).
void drive_request(drive_t *drive, request_t request);
void drive_set(drive_t *drive, const settings_t *settings);
void drive_order(drive_t *drive, const settings_t *order);
// Console or master is alive.
void drive_heard(drive_t *drive);

// Names for people.
const char *drive_state_name(drive_state_t state);
const char *drive_phase_name(phase_t phase);
const char *drive_limit_name(limit_t limit);

#endif
