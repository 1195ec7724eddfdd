// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// The six-step method: pulses for a pair of legs, commutated by the clock, the EMF's crossings or the edges of Hall sensors.
#ifndef FL_SIX_STEP_H
#define FL_SIX_STEP_H

#include "drive/method.h"
#include "drive/six_step/hall.h"
#include "drive/six_step/measure.h"
#include "drive/six_step/pwm.h"
#include "drive/six_step/regulate.h"
#include "drive/six_step/sequence.h"
#include "drive/six_step/start.h"
#include "drive/six_step/thresholds.h"

// The slow protection looks at every eighth tick, never at one at which the watchdog hears of the control steps too
// (REPORT_TICKS of app.c).
#define SIX_STEP_LOOK_TICKS 8u
#define SIX_STEP_LOOK_AT 2u

typedef struct {
  const parameters_t *p;
  measured_t m;
  start_t start;
  regulate_t regulate;
  hall_t hall;
  thresholds_t thresholds;
  pwm_t pwm;
  six_step_command_t command;
  report_t report;
  uint32_t outrun_ticks;  // consecutive, while running
  uint32_t driven_ticks;  // consecutive, of a stop
  int32_t ran_v_q17;      // EMF of the speed before the gates opened
  bool settings_due;      // changed, and not taken yet
} six_step_t;

void six_step_init(six_step_t *six, const parameters_t *p, const settings_t *settings);

// The snapshot's quantities into the report. True: there is something that supervision must look at.
bool six_step_measure(six_step_t *six, const chip_snapshot_t *in, const order_t *order, const settings_t *settings);
// Control.
outcome_t six_step_step(six_step_t *six, const chip_snapshot_t *in, const order_t *order, const settings_t *settings);
// After the outcome was followed: what the chip is to do, what others may know.
void six_step_finish(six_step_t *six, const order_t *order);

// Whether an over-current now is the consequence of a lost lock.
bool six_step_explains(const six_step_t *six, const chip_snapshot_t *in, const order_t *order);
// Begin to coast.
void six_step_start(six_step_t *six, const order_t *order, const settings_t *settings);
// Legs, regulators, injection off.
void six_step_off(six_step_t *six);
// The lock: what was learnt is in doubt.
void six_step_lost(six_step_t *six);

#endif
