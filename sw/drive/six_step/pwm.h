// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// From what the conducting pair is to carry to carrier and pulse.
#ifndef FL_PWM_H
#define FL_PWM_H

#include "control/boundary.h"
#include "control/csc_linearity.h"
#include "drive/six_step/view.h"

typedef struct {
  int32_t u_v_q25;  // mean voltage that the regulator asks for
  int32_t duty_q30;
  uint32_t period_cycles;
  uint32_t pulse_cycles_q8;
  int32_t share_q16;   // of the boundary's current that is asked for, -1..1
  bool discontinuous;  // diodes end the current of each carrier, and the current alone gives the pulse
  bool at_least;       // the pulse is the shortest one in which a crossing can be seen
  bool sync_rect;
} pwm_t;

// What the regulator asks for.
typedef struct {
  int32_t u_v_q25;
  int32_t i_q25;
  uint32_t longest_cycles;           // longest carrier period permitted
  boundary_t boundary;               // for the carrier that the settings ask for
  const csc_linearity_t *linearity;  // corrects the duty for cut pulses, 0: does not
  int32_t dead_steep;                // at the boundary, of what dead times take over the current: 1 is evenly from none on
} pwm_demand_t;

// No pulse, the carrier of the settings' first value: when the gates open the next one soon starts.
void pwm_off(pwm_t *pwm, const parameters_t *p);

// A voltage that drives the start, whatever the current.
void pwm_from_voltage(pwm_t *pwm, const six_step_view_t *view, int32_t u_v_q25, bool sync_rect, uint32_t longest_cycles);

// The shortest pulses in which a sample fits.
void pwm_shortest(pwm_t *pwm, const six_step_view_t *view, uint32_t longest_cycles);

// A current, with the voltage that gives it while it does not stop flowing. About 230 clocks, 400 where it stops.
void pwm_from_demand(pwm_t *pwm, const six_step_view_t *view, const pwm_demand_t *demand, bool sync_rect);

// Crossings claim a speed whose EMF is over four times what the applied voltage leaves after the resistive drop: no rotor
// turns like this. On one that stands, what follows the blanking is taken for a crossing, and it and the commutation
// that it causes chase each other.
bool pwm_is_outrun(const pwm_t *pwm, int32_t emf_v_q25, int32_t drop_v_q25);

#endif
