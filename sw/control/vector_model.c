// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/vector_model.h"

#include "control/placement.h"
#include "control/trig.h"

#define PI_4_Q32 3373259426u
#define SMALL_Q29 ((int32_t)1 << 25)  // 1/16

static uint32_t mul_q30(uint32_t a_q30, uint32_t b_q30) {
  return (uint32_t)(((uint64_t)a_q30 * b_q30 + (1u << 29)) >> 30);
}

HOT int32_t vector_turn_q32(const vector_machine_t *machine, int32_t speed_turn_q36) {
  const int32_t cycles = (int32_t)(machine->period_cycles * machine->harmonic);
  return sat_i32(round_shift((int64_t)speed_turn_q36 * cycles, 4));
}

HOT int32_t vector_action_turn_q32(const vector_machine_t *machine, int32_t speed_turn_q36) {
  const int64_t turn_q32 = vector_turn_q32(machine, speed_turn_q36);
  const int64_t periods_q30 = (int64_t)machine->delay_q30 + ONE_Q30 / 2;
  return (int32_t)(uint32_t)round_shift(turn_q32 * periods_q30, 30);
}

HOT int32_t vector_lead_turn_q32(const vector_machine_t *machine, int32_t speed_turn_q36) {
  return (machine->park == PARK_HELD) ? 0 : vector_action_turn_q32(machine, speed_turn_q36);
}

// (1 - exp(-s)) / s with Phi = exp(-s): by the series where the difference would lose too many digits.
DESIGN static complex_t decay_of_complex_q30(complex_t s_q29, complex_t phi_q30) {
  if (abs_sat(s_q29.re) < SMALL_Q29 && abs_sat(s_q29.im) < SMALL_Q29) {
    const complex_t one = {ONE_Q30, 0};
    const complex_t s_q30 = {2 * s_q29.re, 2 * s_q29.im};
    complex_t sum = {ONE_Q30 - s_q30.re / 5, -s_q30.im / 5};
    sum = complex_sub(one, complex_mul_q30(sum, (complex_t){s_q30.re / 4, s_q30.im / 4}));
    sum = complex_sub(one, complex_mul_q30(sum, (complex_t){s_q30.re / 3, s_q30.im / 3}));
    return complex_sub(one, complex_mul_q30(sum, s_q29));
  }
  complex_gain_t inverse = complex_inverse(s_q29);
  inverse.shift -= 29;
  return complex_gain_apply((complex_t){sat_i32((int64_t)ONE_Q30 - phi_q30.re), -phi_q30.im}, inverse);
}

DESIGN void vector_plant(vector_plant_t *plant, const vector_machine_t *machine) {
  const uint32_t delay_q30 = machine->delay_q30;
  const uint32_t rest_q30 = (uint32_t)ONE_Q30 - delay_q30;
  const decay_t after = decay_q30(mul_q30(machine->resistance_q30, rest_q30));
  const decay_t before = decay_q30(mul_q30(machine->resistance_q30, delay_q30));
  plant->machine = *machine;
  plant->factor_q30 = decay_q30(machine->resistance_q30).factor_q30;
  plant->share_q30 = after.slope_q30;
  const uint32_t held_q30 = mul_q30((uint32_t)before.slope_q30, (uint32_t)after.factor_q30);
  plant->held_q30 = (int32_t)mul_q30(delay_q30, held_q30);
}

DESIGN void vector_model(vector_model_t *model, const vector_plant_t *plant, int32_t speed_turn_q36) {
  const vector_machine_t *machine = &plant->machine;
  const int32_t turn_q32 = vector_turn_q32(machine, speed_turn_q36);
  const complex_t back_q30 = cis_q30(0u - (uint32_t)turn_q32);
  const uint32_t lead = (uint32_t)vector_lead_turn_q32(machine, speed_turn_q36);

  model->turn_rad_q29 = (int32_t)(((int64_t)turn_q32 * PI_4_Q32 + ((int64_t)1 << 31)) >> 32);
  model->phi_q30 = complex_scale_q30(back_q30, plant->factor_q30);
  const complex_t action1_q30 = (lead == 0u) ? back_q30 : cis_q30(lead - (uint32_t)turn_q32);
  const complex_t action2_q30 = complex_mul_q30(action1_q30, back_q30);
  model->gamma1_share_q30 = complex_scale_q30(action1_q30, plant->share_q30);
  model->gamma1_q30 = complex_scale_q30(model->gamma1_share_q30, ONE_Q30 - (int32_t)machine->delay_q30);
  model->gamma2_q30 = complex_scale_q30(action2_q30, plant->held_q30);
  const complex_t s_q29 = {(int32_t)(machine->resistance_q30 >> 1), model->turn_rad_q29};
  const complex_t mean_q30 = decay_of_complex_q30(s_q29, model->phi_q30);
  model->gamma_e_q30 = (complex_t){-mean_q30.re, -mean_q30.im};
}

DESIGN void vector_model_join(vector_model_t *model, uint32_t periods) {
  const int32_t share_q30 = (int32_t)((uint32_t)ONE_Q30 / periods);
  complex_t last_q30 = {ONE_Q30, 0};
  complex_t mean_q30 = {share_q30, 0};
  for (uint32_t k = 1; k < periods; k++) {
    last_q30 = complex_mul_q30(last_q30, model->phi_q30);
    mean_q30 = complex_add(mean_q30, complex_scale_q30(last_q30, share_q30));
  }
  const complex_t both_q30 = complex_add(model->gamma1_q30, model->gamma2_q30);
  model->gamma2_q30 = complex_mul_q30(model->gamma2_q30, complex_scale_q30(last_q30, share_q30));
  model->gamma1_q30 = complex_sub(complex_mul_q30(both_q30, mean_q30), model->gamma2_q30);
  model->gamma_e_q30 = complex_mul_q30(model->gamma_e_q30, mean_q30);
  model->phi_q30 = complex_mul_q30(model->phi_q30, last_q30);
}

// mant * 2^-shift with 30 bits, mant > 0.
static gain_t normalised(uint64_t mant, int32_t shift) {
  while (mant > (uint64_t)INT32_MAX) {
    mant >>= 1;
    shift--;
  }
  return (gain_t){(int32_t)mant, shift};
}

COLD void vector_machine_join(vector_machine_t *machine, uint32_t periods) {
  const gain_t y = machine->admittance;
  const gain_t z = machine->impedance;
  machine->admittance = normalised((uint64_t)(uint32_t)y.mant * periods, y.shift);
  machine->impedance = normalised(div_u64((uint64_t)(uint32_t)z.mant << 31, periods), z.shift + 31);
  machine->period_cycles *= periods;
}
