// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "drive/six_step/pwm.h"

#include "control/carrier.h"
#include "control/fixed.h"
#include "control/placement.h"

#define ONE_Q16 65536
#define RATIO_MAX_Q12 (64u << 12)

void pwm_off(pwm_t *pwm, const parameters_t *p) {
  pwm->period_cycles = (uint32_t)p->carrier_period_cycles;
  pwm->u_v_q25 = 0;
  pwm->duty_q30 = 0;
  pwm->pulse_cycles_q8 = 0;
  pwm->discontinuous = false;
}

void pwm_from_voltage(pwm_t *pwm, const six_step_view_t *view, int32_t u_v_q25, bool sync_rect, uint32_t longest_cycles) {
  const parameters_t *p = view->p;
  const int32_t diode = sync_rect ? 0 : p->diode_v_q25;
  pwm->u_v_q25 = u_v_q25;
  pwm->duty_q30 = duty_from_voltage_q30(u_v_q25, view->m->vdc_v_q25, diode);
  pwm->period_cycles = carrier_period_cycles(pwm->duty_q30, view->settings->carrier_period_cycles, longest_cycles,
                                             (uint32_t)p->on_time_floor_cycles);
  pwm->sync_rect = sync_rect;
  pwm->discontinuous = false;
  pwm->pulse_cycles_q8 = pulse_cycles_q8(pwm->duty_q30, pwm->period_cycles, sync_rect ? p->dead_time_cycles * 256 : 0);
}

void pwm_shortest(pwm_t *pwm, const six_step_view_t *view, uint32_t longest_cycles) {
  pwm_from_voltage(pwm, view, 0, true, longest_cycles);
  pwm->pulse_cycles_q8 = (uint32_t)view->p->least_on_cycles << 8;
}

// The square of the pulse is proportional to current and carrier: a longer carrier keeps it long enough for a crossing.
HOT static int32_t stretch(pwm_t *pwm, int32_t duty_q30, uint32_t longest_cycles, uint32_t floor_cycles) {
  const uint32_t pulse_cycles = (uint32_t)mul_q16(duty_q30 >> 14, (int32_t)pwm->period_cycles);
  if (pulse_cycles >= floor_cycles || pwm->period_cycles >= longest_cycles) {
    return duty_q30;
  }
  const uint32_t ratio_q12 = (floor_cycles << 12) / ((pulse_cycles > 0u) ? pulse_cycles : 1u);
  const uint64_t wanted = (ratio_q12 < RATIO_MAX_Q12) ? ((uint64_t)pwm->period_cycles * ratio_q12 * ratio_q12) >> 24 : UINT32_MAX;
  if (wanted < longest_cycles) {
    pwm->period_cycles = (uint32_t)wanted;
    return mul_q16(duty_q30, (int32_t)((pulse_cycles << 16) / floor_cycles));
  }
  const uint32_t shorter_q16 = (pwm->period_cycles << 16) / longest_cycles;
  pwm->period_cycles = longest_cycles;
  return mul_q16(duty_q30, (int32_t)sqrt_u32(shorter_q16 << 16));
}

// Of the boundary for the carrier that is applied: its current is proportional to the period.
HOT static int32_t share_q16(const pwm_t *pwm, const six_step_view_t *view, const pwm_demand_t *demand) {
  const uint32_t wanted_cycles = view->settings->carrier_period_cycles;
  const bool longer = pwm->period_cycles > wanted_cycles;
  const int32_t i_q25 =
      longer ? mul_q16(demand->i_q25, (int32_t)((wanted_cycles << 16) / pwm->period_cycles)) : demand->i_q25;
  return boundary_share_q16(&demand->boundary, i_q25);
}

// Duty by the law of discontinuous conduction, for a share below 1. Where commutations cut the last carrier, the squares
// of the pulses have to make the mean.
HOT static int32_t discontinuous_duty(pwm_t *pwm, const six_step_view_t *view, const pwm_demand_t *demand) {
  const int32_t share = (pwm->share_q16 > 0) ? pwm->share_q16 : 0;
  int32_t duty_q30 = discontinuous_duty_q30(&demand->boundary, share);
  if (demand->linearity != 0 && duty_q30 <= (int32_t)(demand->linearity->rest_q16 << 14)) {
    duty_q30 = discontinuous_duty_q30(&demand->boundary, mul_q16(share, (int32_t)demand->linearity->first_q16));
  }
  return stretch(pwm, duty_q30, demand->longest_cycles, (uint32_t)view->p->on_time_floor_cycles);
}

// What dead times take of a pulse: all where the current keeps its sign over the carrier, less and less below, as steeply as told.
HOT static int32_t dead_share_q16(int32_t share_q16, int32_t steep) {
  const int32_t taken_q16 = ONE_Q16 - (ONE_Q16 - abs_sat(share_q16)) * steep;
  const int32_t some_q16 = (taken_q16 > 0) ? taken_q16 : 0;
  return (share_q16 < 0) ? -some_q16 : some_q16;
}

HOT void pwm_from_demand(pwm_t *pwm, const six_step_view_t *view, const pwm_demand_t *demand, bool sync_rect) {
  const parameters_t *p = view->p;
  const int32_t vdc_v_q25 = view->m->vdc_v_q25;
  pwm->u_v_q25 = demand->u_v_q25;
  pwm->sync_rect = sync_rect;
  int32_t duty_q30 = duty_from_voltage_q30(demand->u_v_q25, vdc_v_q25, sync_rect ? 0 : p->diode_v_q25);
  pwm->period_cycles = carrier_period_cycles(duty_q30, view->settings->carrier_period_cycles, demand->longest_cycles,
                                             (uint32_t)p->on_time_floor_cycles);
  pwm->share_q16 = share_q16(pwm, view, demand);
  pwm->discontinuous = false;
  const int32_t linear_q30 = (demand->linearity != 0) ? csc_linear_duty_q30(demand->linearity, duty_q30) : duty_q30;
  int32_t pulse_q30 = linear_q30;
  if (!sync_rect && pwm->share_q16 < ONE_Q16) {
    const uint32_t period_cycles = pwm->period_cycles;
    const int32_t less_q30 = discontinuous_duty(pwm, view, demand);
    pwm->discontinuous = less_q30 <= linear_q30;
    if (pwm->discontinuous) {
      duty_q30 = less_q30;
      pulse_q30 = less_q30;
    } else {
      pwm->period_cycles = period_cycles;
    }
  }
  pwm->duty_q30 = duty_q30;
  const int32_t added_q8 = sync_rect ? p->dead_time_cycles * dead_share_q16(pwm->share_q16, demand->dead_steep) / 256 : 0;
  const uint32_t pulse_q8 = pulse_cycles_q8(pulse_q30, pwm->period_cycles, added_q8);
  const uint32_t least_q8 = (uint32_t)p->least_on_cycles << 8;
  pwm->at_least = pulse_q8 < least_q8;
  pwm->pulse_cycles_q8 = pwm->at_least ? least_q8 : pulse_q8;
}

HOT bool pwm_is_outrun(const pwm_t *pwm, int32_t emf_v_q25, int32_t drop_v_q25) {
  return emf_v_q25 / 4 > pwm->u_v_q25 - drop_v_q25;
}
