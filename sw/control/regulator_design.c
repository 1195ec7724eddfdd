// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/regulator_design.h"

#include "control/placement.h"

#define MANTISSA_BITS 17
#define MANTISSA_MAX ((1 << MANTISSA_BITS) - 1)
#define SHIFT_MAX 31
// From a current q17 to a voltage q25.
#define OUTPUT_BITS 8

static int32_t larger(int32_t a, int32_t b) { return (a > b) ? a : b; }

static int32_t longest_part(complex_t z) { return larger(abs_sat(z.re), abs_sat(z.im)); }

DESIGN static complex_t drop_bits(complex_t z, int32_t bits) {
  if (bits < 0) {
    return (complex_t){z.re * (1 << -bits), z.im * (1 << -bits)};
  }
  return (complex_t){(int32_t)round_shift(z.re, bits), (int32_t)round_shift(z.im, bits)};
}

// z 2^-shift in the format of h/g.
DESIGN static complex_t to_ratio_q17(complex_t z, int32_t shift) {
  const complex_t ratio = drop_bits(z, shift - MANTISSA_BITS);
  return (complex_t){clamp_i32(ratio.re, -MANTISSA_MAX, MANTISSA_MAX), clamp_i32(ratio.im, -MANTISSA_MAX, MANTISSA_MAX)};
}

// Round g and h, both times 2^-shift, to the format of the regulator.
DESIGN static bool round_gains(regulator_gains_t *gains, complex_t g, complex_t h, int32_t shift) {
  const int32_t longest = larger(longest_part(g), longest_part(h));
  if (longest == 0) {
    gains->g = gains->h = (complex_t){0, 0};
    gains->shift = 0;
    return true;
  }
  int32_t drop = 32 - __builtin_clz((uint32_t)longest) - MANTISSA_BITS;
  if (round_shift(longest, (drop > 0) ? drop : 0) > MANTISSA_MAX) {
    drop++;
  }
  // Very small gains keep fewer bits.
  drop = larger(drop, shift - SHIFT_MAX);
  if (drop > shift || drop > SHIFT_MAX) {
    return false;
  }
  gains->g = drop_bits(g, drop);
  gains->h = drop_bits(h, drop);
  gains->shift = shift - drop;
  return true;
}

DESIGN bool regulator_design(regulator_gains_t *gains, const regulator_design_t *design, const vector_machine_t *machine,
                      const vector_model_t *model) {
  complex_t g;
  complex_t h;
  complex_t ratio_q17;
  int32_t shift;
  if (design->order == REGULATOR_A) {
    const complex_t growth_q29 = {ONE_Q30 / 2 + (int32_t)(machine->resistance_q30 >> 1), model->turn_rad_q29};
    g = complex_scale_q30(growth_q29, design->bandwidth_q30);
    h = (complex_t){design->bandwidth_q30 / 2, 0};
    shift = 29;
    const complex_gain_t inverse = complex_inverse(growth_q29);
    ratio_q17 = to_ratio_q17((complex_t){inverse.re, inverse.im}, inverse.shift - 29);
  } else {
    complex_t plant_q30 = complex_add(model->gamma1_q30, model->gamma2_q30);
    if (design->order == REGULATOR_B) {
      const bool whole_period = machine->delay_q30 == (uint32_t)ONE_Q30;
      plant_q30 = whole_period ? model->gamma2_q30 : model->gamma1_share_q30;
    }
    const complex_gain_t inverse = complex_inverse(plant_q30);
    g = complex_scale_q30((complex_t){inverse.re, inverse.im}, design->gamma_q30);
    h = complex_mul_q30(g, model->phi_q30);
    ratio_q17 = to_ratio_q17(model->phi_q30, 30);
    shift = inverse.shift - 30;
  }
  // Upper half of the products with the impedance's mantissa.
  const complex_gain_t impedance = {machine->impedance.mant, 0, 31};
  if (!round_gains(gains, complex_gain_apply(g, impedance), complex_gain_apply(h, impedance),
                   shift + machine->impedance.shift - 31 - OUTPUT_BITS)) {
    return false;
  }
  gains->ratio_q17 = ratio_q17;
  return true;
}
