// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// The beginning of every start: gates off until the EMF is small enough to be shorted by the lower switches, or large
// enough to take the rotor over at its speed. Both methods own one, it knows neither.
#ifndef FL_COAST_H
#define FL_COAST_H

#include "control/catch.h"
#include "control/stuck.h"
#include "control/winding.h"
#include "drive/method.h"

// Latched trips of before are gone by then.
#define COAST_SETTLE_TICKS 4u

typedef enum { COAST_WAIT, COAST_AT_REST, COAST_FAULT } coast_result_t;

typedef struct {
  catch_t rotor;
  stuck_t stuck;
  winding_t winding;
  winding_verdict_t verdict;
  uint32_t calm_ticks;
  int32_t v_q17[PHASES];  // restored terminal voltages of the tick
  int32_t line_emf_q17;
  int32_t pair_emf_q17;   // its mean while the angle turns evenly: of the pair that would conduct, whatever the flux
  int32_t mean_step_q32;  // of a caught rotor's angle, a tick
  int32_t speed_rpm_q8;   // the same, a magnitude
  fault_t fault;          // with COAST_FAULT
} coast_t;

void coast_begin(coast_t *coast);

// The terminal voltages of a tick. Once a tick, before the others.
void coast_see(coast_t *coast, const parameters_t *p, const chip_snapshot_t *in);

// After an over-current, with three phases: the winding, before anything is energised. A rotor without an EMF shows nothing.
winding_verdict_t coast_winding(coast_t *coast, const order_t *order);

// A rotor may be caught: channels that show an EMF without a rotor are given up. What a load has turned is no such failure.
bool coast_may_catch(const order_t *order, const settings_t *settings);

// The rotor turns fast enough, plausibly, in whichever direction: rotor.angle, mean_step_q32 and speed_rpm_q8 say how.
bool coast_caught(coast_t *coast, const parameters_t *p, const order_t *order, const settings_t *settings,
                  int32_t vdc_v_q25);

// Calm enough for long enough: the more often a start failed, the longer. Voltage channels may fail for a while and show no
// EMF.
bool coast_calm(coast_t *coast, const parameters_t *p, const order_t *order);
uint32_t coast_calm_ticks(const order_t *order);

// A voltage channel that keeps its value beside others that swing.
bool coast_stuck(coast_t *coast, const parameters_t *p, const chip_snapshot_t *in);

// calm: the rotor is slow enough. What that means once the link's voltage and the time were judged.
coast_result_t coast_judge(coast_t *coast, const parameters_t *p, const order_t *order, bool calm, int32_t vdc_v_q25);

#endif
