// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/emf_observer.h"

#include "control/placement.h"

// Four full scales: no sum of products leaves 32 bits.
#define CURRENT_MAX ((1 << 27) - 1)
// Bits below q25 of what is multiplied by its upper half. Those of the EMF depend on the admittance: where little
// voltage makes much current it is small and finely resolved.
#define MEASURED_BITS 4
#define ERROR_BITS 3
#define VOLTAGE_BITS 5
#define GAMMA_SHIFT_MAX 28

// Real and imaginary part of a product, upper halves.
static inline int32_t high_re(complex_t a, complex_t b) { return mul_high_i32(a.re, b.re) - mul_high_i32(a.im, b.im); }

static inline int32_t high_im(complex_t a, complex_t b) { return mul_high_i32(a.re, b.im) + mul_high_i32(a.im, b.re); }

static inline complex_t fine(complex_t z, int32_t bits) { return (complex_t){z.re * (1 << bits), z.im * (1 << bits)}; }

// x * 2^-down, rounded half up. wide: also for negative ones, where it is limited.
static inline int32_t shifted(int32_t x, int32_t down, int32_t most, bool wide) {
  if (!wide || down > 0) {
    return ((x >> (down - 1)) + 1) >> 1;
  }
  const int32_t bound = most >> -down;
  return within_i32(x, bound) * (1 << -down);
}

// a exp(-j x) to the first order.
static inline complex_t turned(complex_t a, int32_t x_q32) {
  return (complex_t){a.re + mul_high_i32(a.im, x_q32), a.im - mul_high_i32(a.re, x_q32)};
}

DESIGN static complex_t drop_bits(complex_t z, int32_t bits) {
  return (complex_t){(int32_t)round_shift(z.re, bits), (int32_t)round_shift(z.im, bits)};
}

DESIGN void emf_observer_design(emf_observer_gains_t *gains, const vector_machine_t *machine, const vector_model_t *model,
                         int32_t pole1_q30, int32_t pole2_q30) {
  const complex_gain_t inverse = complex_inverse(model->gamma_e_q30);
  const complex_gain_t impedance = {machine->impedance.mant, 0, 31};
  const complex_t scaled = complex_gain_apply((complex_t){inverse.re, inverse.im}, impedance);
  const int64_t product = (int64_t)(ONE_Q30 - pole1_q30) * (ONE_Q30 - pole2_q30);
  const complex_t g2 = complex_scale_q30(scaled, (int32_t)round_shift(product, 30));
  // Many bits are left for the rounding: a bias of e^ is one of i^ times 1 / G2.
  const int32_t up = __builtin_clz((uint32_t)(abs_sat(g2.re) | abs_sat(g2.im)) | 1u) - 1;
  const int32_t emf_shift = inverse.shift - 30 + machine->impedance.shift - 31 + ERROR_BITS - 32 + up;
  gains->emf_gain = (complex_t){g2.re * (1 << up), g2.im * (1 << up)};
  gains->emf_shift = (emf_shift < 31) ? emf_shift : 31;
  // Gamma q30 times the admittance's 31 bits, upper half: times 2^(admittance.shift - 1), below 2^30.
  const complex_gain_t admittance = {machine->admittance.mant, 0, 31};
  const int32_t gamma_shift = machine->admittance.shift - 1;
  const int32_t shift = (gamma_shift < GAMMA_SHIFT_MAX) ? gamma_shift : GAMMA_SHIFT_MAX;
  gains->gamma1 = drop_bits(complex_gain_apply(model->gamma1_q30, admittance), gamma_shift - shift);
  gains->gamma2 = drop_bits(complex_gain_apply(model->gamma2_q30, admittance), gamma_shift - shift);
  gains->gamma_e = drop_bits(complex_gain_apply(model->gamma_e_q30, admittance), gamma_shift - shift);
  gains->phi_q30 = model->phi_q30;
  gains->innovation_q30 = ONE_Q30 - pole1_q30 - pole2_q30;
  gains->shift = shift + VOLTAGE_BITS - 32;
  // 2 bits up to an admittance of 1/2, 4 from 1 on.
  gains->emf_bits = clamp_i32(33 - gamma_shift, 2, 4);
  gains->wide = gains->shift <= 0 || gains->emf_shift <= 0;
}

void emf_observer_preset(emf_observer_t *observer, complex_t current_i_q17, complex_t emf_v_q25,
                         complex_t voltage_v_q25) {
  observer->current_i_q25 = (complex_t){current_i_q17.re * 256, current_i_q17.im * 256};
  observer->emf_v_q25 = emf_v_q25;
  observer->voltage_v_q25 = voltage_v_q25;
}

COLD void emf_observer_turn(emf_observer_t *observer, complex_t rotation_q30) {
  observer->current_i_q25 = complex_mul_q30(observer->current_i_q25, rotation_q30);
  observer->emf_v_q25 = complex_mul_q30(observer->emf_v_q25, rotation_q30);
  observer->voltage_v_q25 = complex_mul_q30(observer->voltage_v_q25, rotation_q30);
}

INLINED void emf_observer_turn_small(emf_observer_t *observer, int32_t turn_rad_q32) {
  observer->current_i_q25 = turned(observer->current_i_q25, turn_rad_q32);
  observer->emf_v_q25 = turned(observer->emf_v_q25, turn_rad_q32);
  observer->voltage_v_q25 = turned(observer->voltage_v_q25, turn_rad_q32);
}

// Products are rounded down; those that are not subtracted from each other would add up to a bias.
INLINED static void predict(emf_observer_t *observer, const emf_observer_gains_t *gains, complex_t current_i_q17,
                            int32_t drift_rad_q32, bool wide) {
  const complex_t current = {current_i_q17.re * 256, current_i_q17.im * 256};
  const complex_t measured = turned(fine(current, MEASURED_BITS), drift_rad_q32);
  const complex_t error = fine(complex_sub(current, observer->current_i_q25), ERROR_BITS);
  const complex_t before = fine(observer->voltage_v_q25, VOLTAGE_BITS);
  const int32_t emf_weight = 1 << (VOLTAGE_BITS - gains->emf_bits);
  const int32_t emf_most = 1 << (30 - gains->emf_bits);
  const complex_t old = observer->emf_v_q25;
  const complex_t emf = fine(old, gains->emf_bits);
  // q27: phi and innovation have 30 bits.
  const int32_t own_re = high_re(measured, gains->phi_q30) + 2 * mul_high_i32(error.re, gains->innovation_q30) + 1;
  const int32_t own_im = high_im(measured, gains->phi_q30) + 2 * mul_high_i32(error.im, gains->innovation_q30) + 2;
  const int32_t driven_re = high_re(before, gains->gamma2) + high_re(emf, gains->gamma_e) * emf_weight;
  const int32_t driven_im = high_im(before, gains->gamma2) + 1 + (high_im(emf, gains->gamma_e) + 1) * emf_weight;
  const int32_t re = ((own_re + 2) >> 2) + shifted(driven_re, gains->shift, CURRENT_MAX, wide);
  const int32_t im = ((own_im + 2) >> 2) + shifted(driven_im, gains->shift, CURRENT_MAX, wide);
  observer->current_i_q25 = (complex_t){within_i32(re, CURRENT_MAX), within_i32(im, CURRENT_MAX)};
  const int32_t change_re = shifted(high_re(error, gains->emf_gain), gains->emf_shift, emf_most, wide);
  const int32_t change_im = shifted(high_im(error, gains->emf_gain) + 1, gains->emf_shift, emf_most, wide);
  observer->emf_v_q25 = (complex_t){within_i32(old.re + change_re, emf_most), within_i32(old.im + change_im, emf_most)};
}

INLINED static void drive(emf_observer_t *observer, const emf_observer_gains_t *gains, complex_t voltage_v_q25, bool wide) {
  const complex_t now = fine(voltage_v_q25, VOLTAGE_BITS);
  const complex_t current = observer->current_i_q25;
  const int32_t re = current.re + shifted(high_re(now, gains->gamma1), gains->shift, CURRENT_MAX, wide);
  const int32_t im = current.im + shifted(high_im(now, gains->gamma1) + 1, gains->shift, CURRENT_MAX, wide);
  observer->current_i_q25 = (complex_t){within_i32(re, CURRENT_MAX), within_i32(im, CURRENT_MAX)};
  observer->voltage_v_q25 = voltage_v_q25;
}

// Where little voltage makes much current: one branch keeps it out of the usual way.
SHARED static void predict_wide(emf_observer_t *observer, const emf_observer_gains_t *gains, complex_t current_i_q17,
                                int32_t drift_rad_q32) {
  predict(observer, gains, current_i_q17, drift_rad_q32, true);
}

SHARED static void drive_wide(emf_observer_t *observer, const emf_observer_gains_t *gains, complex_t voltage_v_q25) {
  drive(observer, gains, voltage_v_q25, true);
}

INLINED void emf_observer_step(emf_observer_t *observer, const emf_observer_gains_t *gains, complex_t current_i_q17,
                               int32_t drift_rad_q32) {
  if (__builtin_expect(gains->wide, 0)) {
    predict_wide(observer, gains, current_i_q17, drift_rad_q32);
  } else {
    predict(observer, gains, current_i_q17, drift_rad_q32, false);
  }
}

INLINED void emf_observer_voltage(emf_observer_t *observer, const emf_observer_gains_t *gains, complex_t voltage_v_q25) {
  if (__builtin_expect(gains->wide, 0)) {
    drive_wide(observer, gains, voltage_v_q25);
  } else {
    drive(observer, gains, voltage_v_q25, false);
  }
}
