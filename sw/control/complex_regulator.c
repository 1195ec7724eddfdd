// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/complex_regulator.h"

#include "control/placement.h"
#include "control/trig.h"

#define ERROR_MAX_Q17 ((1 << 17) - 1)
#define VOLTAGE_MAX_Q25 ((1 << 27) - 1)
#define VOLTAGE_MIN_Q25 (-(1 << 27))

// state + sum * 2^-shift, saturated to 28 bits.
static int32_t accumulate(int32_t state, int64_t sum, int32_t shift) {
  const int64_t next = state + round_shift(sum, shift);
  if (next > VOLTAGE_MAX_Q25) {
    return VOLTAGE_MAX_Q25;
  }
  return (next < VOLTAGE_MIN_Q25) ? VOLTAGE_MIN_Q25 : (int32_t)next;
}

static int32_t shrink(int32_t x, uint32_t factor_q17) {
  return (int32_t)(((int64_t)x * (int32_t)factor_q17 + (1 << 16)) >> 17);
}

// floor(sqrt(s)) > limit is s >= (limit + 1)^2.
HOT complex_t circle_limit_v_q25(complex_t voltage_v_q25, int32_t limit_v_q17, bool *limited) {
  const complex_t v = voltage_v_q17(voltage_v_q25);
  const int64_t beyond = (int64_t)(limit_v_q17 + 1) * (limit_v_q17 + 1);
  *limited = (int64_t)v.re * v.re + (int64_t)v.im * v.im >= beyond;
  if (!*limited) {
    return voltage_v_q25;
  }
  const uint32_t factor_q17 = div_sat_u32((uint64_t)(uint32_t)limit_v_q17 << 17, complex_abs(v));
  return (complex_t){shrink(voltage_v_q25.re, factor_q17), shrink(voltage_v_q25.im, factor_q17)};
}

void complex_regulator_preset(complex_regulator_t *regulator, complex_t voltage_v_q25, complex_t error_i_q17) {
  regulator->voltage_v_q25 = voltage_v_q25;
  regulator->error_i_q17 = error_i_q17;
  regulator->carry_v_q25 = (complex_t){0, 0};
}

void complex_regulator_turn(complex_regulator_t *regulator, complex_t rotation_q30) {
  regulator->voltage_v_q25 = complex_mul_q30(regulator->voltage_v_q25, rotation_q30);
  regulator->error_i_q17 = complex_mul_q30(regulator->error_i_q17, rotation_q30);
  regulator->carry_v_q25 = complex_mul_q30(regulator->carry_v_q25, rotation_q30);
}

HOT complex_t complex_regulator_want(complex_regulator_t *regulator, const regulator_gains_t *gains,
                                     complex_t reference_i_q17, complex_t current_i_q17) {
  const complex_t difference = complex_sub(reference_i_q17, current_i_q17);
  const complex_t now = {clamp_i32(difference.re, -ERROR_MAX_Q17, ERROR_MAX_Q17),
                         clamp_i32(difference.im, -ERROR_MAX_Q17, ERROR_MAX_Q17)};
  const complex_t last = regulator->error_i_q17;
  const complex_t g = gains->g;
  const complex_t h = gains->h;
  const int64_t d = (int64_t)g.re * now.re - (int64_t)g.im * now.im - (int64_t)h.re * last.re + (int64_t)h.im * last.im;
  const int64_t q = (int64_t)g.re * now.im + (int64_t)g.im * now.re - (int64_t)h.re * last.im - (int64_t)h.im * last.re;
  const complex_t base = complex_add(regulator->voltage_v_q25, regulator->carry_v_q25);
  regulator->error_i_q17 = now;
  return (complex_t){accumulate(base.re, d, gains->shift), accumulate(base.im, q, gains->shift)};
}

HOT bool complex_regulator_bound(complex_regulator_t *regulator, const regulator_gains_t *gains, complex_t wanted,
                                 int32_t limit_v_q17) {
  bool limited;
  const complex_t bound = circle_limit_v_q25(wanted, limit_v_q17, &limited);
  regulator->voltage_v_q25 = bound;
  regulator->carry_v_q25 = (complex_t){0, 0};
  if (limited) {
    const complex_t taken_v_q15 = {(wanted.re - bound.re) >> 10, (wanted.im - bound.im) >> 10};
    const complex_gain_t ratio = {gains->ratio_q17.re, gains->ratio_q17.im, 7};
    regulator->carry_v_q25 = complex_gain_apply(taken_v_q15, ratio);
  }
  return limited;
}

HOT bool complex_regulator_step(complex_regulator_t *regulator, const regulator_gains_t *gains,
                                complex_t reference_i_q17, complex_t current_i_q17, int32_t limit_v_q17) {
  const complex_t wanted = complex_regulator_want(regulator, gains, reference_i_q17, current_i_q17);
  return complex_regulator_bound(regulator, gains, wanted, limit_v_q17);
}
