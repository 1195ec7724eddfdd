// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// From the voltage of the conducting pair to carrier and pulse.
#ifndef FL_PWM_H
#define FL_PWM_H

#include "control/csc_linearity.h"
#include "drive/six_step/view.h"

typedef struct {
  int32_t u_v_q25;  // mean voltage applied to the conducting pair
  int32_t duty_q30;
  uint32_t period_cycles;
  uint32_t pulse_cycles_q8;
  bool sync_rect;
} pwm_t;

void pwm_init(pwm_t *pwm, const parameters_t *p);
void pwm_off(pwm_t *pwm);

// longest_cycles: longest carrier period permitted; linearity: corrects the duty for cut pulses, 0: does not.
void pwm_from_voltage(pwm_t *pwm, const six_step_view_t *view, int32_t u_v_q25, bool sync_rect,
                      uint32_t longest_cycles, const csc_linearity_t *linearity);

// Crossings claim a speed whose EMF is over four times what the applied voltage leaves after the resistive drop: no rotor
// turns like this. On one that stands, what follows the blanking is taken for a crossing, and it and the commutation
// that it causes chase each other. A drive that brakes applies at least half of the EMF, or what its braking current leaves of it.
bool pwm_is_outrun(const pwm_t *pwm, const parameters_t *p, int32_t speed_rpm_q8, int32_t drop_v_q25);

#endif
