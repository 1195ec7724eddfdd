// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "drive/six_step/pwm.h"

#include "control/carrier.h"
#include "control/fixed.h"
#include "control/placement.h"

void pwm_init(pwm_t *pwm, const parameters_t *p) { pwm->period_cycles = (uint32_t)p->carrier_longest_cycles; }

void pwm_off(pwm_t *pwm) {
  pwm->u_v_q25 = 0;
  pwm->duty_q30 = 0;
  pwm->pulse_cycles_q8 = 0;
}

HOT void pwm_from_voltage(pwm_t *pwm, const six_step_view_t *view, int32_t u_v_q25, bool sync_rect,
                          uint32_t longest_cycles, const csc_linearity_t *linearity) {
  const parameters_t *p = view->p;
  const int32_t diode = sync_rect ? 0 : p->diode_v_q25;
  const uint32_t dead_time = sync_rect ? (uint32_t)p->dead_time_cycles : 0u;
  pwm->u_v_q25 = u_v_q25;
  pwm->duty_q30 = duty_from_voltage_q30(u_v_q25, view->m->vdc_v_q25, diode);
  pwm->period_cycles = carrier_period_cycles(pwm->duty_q30, view->settings->carrier_period_cycles, longest_cycles,
                                             (uint32_t)p->on_time_floor_cycles);
  const int32_t duty_q30 = (linearity != 0) ? csc_linear_duty_q30(linearity, pwm->duty_q30) : pwm->duty_q30;
  pwm->sync_rect = sync_rect;
  pwm->pulse_cycles_q8 = pulse_cycles_q8(duty_q30, pwm->period_cycles, dead_time);
}

HOT bool pwm_is_outrun(const pwm_t *pwm, const parameters_t *p, int32_t speed_rpm_q8, int32_t drop_v_q25) {
  return gain_apply(speed_rpm_q8, p->emf) / 4 > pwm->u_v_q25 - drop_v_q25;
}
