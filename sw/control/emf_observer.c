#include "control/emf_observer.h"

#include "control/placement.h"

#define STATE_MAX ((1 << 29) - 1)

static int32_t limit_state(int64_t x) {
  if (x > STATE_MAX) {
    return STATE_MAX;
  }
  return (x < -STATE_MAX) ? -STATE_MAX : (int32_t)x;
}

// Real and imaginary part of a product, exactly.
static inline int64_t product_re(complex_t a, complex_t b) { return (int64_t)a.re * b.re - (int64_t)a.im * b.im; }

static inline int64_t product_im(complex_t a, complex_t b) { return (int64_t)a.re * b.im + (int64_t)a.im * b.re; }

COLD static complex_t drop_bits(complex_t z, int32_t bits) {
  return (complex_t){(int32_t)round_shift(z.re, bits), (int32_t)round_shift(z.im, bits)};
}

static complex_t current_q25(complex_t current_i_q17) {
  return (complex_t){current_i_q17.re * 256, current_i_q17.im * 256};
}

COLD void emf_observer_design(emf_observer_gains_t *gains, const vector_machine_t *machine, const vector_model_t *model,
                         int32_t pole1_q30, int32_t pole2_q30) {
  const complex_gain_t inverse = complex_inverse(model->gamma_e_q30);
  const complex_gain_t impedance = {machine->impedance.mant, 0, 31};
  const complex_t scaled = complex_gain_apply((complex_t){inverse.re, inverse.im}, impedance);
  const int64_t product = (int64_t)(ONE_Q30 - pole1_q30) * (ONE_Q30 - pole2_q30);
  const complex_t g2 = complex_scale_q30(scaled, (int32_t)round_shift(product, 30));
  gains->emf_gain = (complex_gain_t){g2.re, g2.im, inverse.shift - 30 + machine->impedance.shift - 31};
  // Gamma q30 times the admittance's 31 bits, upper half: times 2^(admittance.shift - 1), below 2^30.
  const complex_gain_t admittance = {machine->admittance.mant, 0, 31};
  const int32_t gamma_shift = machine->admittance.shift - 1;
  const int32_t shift = (gamma_shift < 30) ? gamma_shift : 30;
  gains->gamma1 = drop_bits(complex_gain_apply(model->gamma1_q30, admittance), gamma_shift - shift);
  gains->gamma2 = drop_bits(complex_gain_apply(model->gamma2_q30, admittance), gamma_shift - shift);
  gains->gamma_e = drop_bits(complex_gain_apply(model->gamma_e_q30, admittance), gamma_shift - shift);
  gains->phi = drop_bits(model->phi_q30, 30 - shift);
  gains->innovation = (int32_t)round_shift(ONE_Q30 - pole1_q30 - pole2_q30, 30 - shift);
  gains->shift = shift;
}

void emf_observer_preset(emf_observer_t *observer, complex_t current_i_q17, complex_t emf_v_q25,
                         complex_t voltage_v_q25) {
  observer->current_i_q25 = current_q25(current_i_q17);
  observer->emf_v_q25 = emf_v_q25;
  observer->voltage_v_q25 = voltage_v_q25;
}

COLD void emf_observer_turn(emf_observer_t *observer, complex_t rotation_q30) {
  observer->current_i_q25 = complex_mul_q30(observer->current_i_q25, rotation_q30);
  observer->emf_v_q25 = complex_mul_q30(observer->emf_v_q25, rotation_q30);
  observer->voltage_v_q25 = complex_mul_q30(observer->voltage_v_q25, rotation_q30);
}

HOT void emf_observer_turn_small(emf_observer_t *observer, int32_t turn_rad_q30) {
  observer->current_i_q25 = complex_turn_small(observer->current_i_q25, turn_rad_q30);
  observer->emf_v_q25 = complex_turn_small(observer->emf_v_q25, turn_rad_q30);
  observer->voltage_v_q25 = complex_turn_small(observer->voltage_v_q25, turn_rad_q30);
}

HOT void emf_observer_step(emf_observer_t *observer, const emf_observer_gains_t *gains, complex_t current_i_q17,
                           complex_t voltage_v_q25) {
  const complex_t current = current_q25(current_i_q17);
  const complex_t error = complex_sub(current, observer->current_i_q25);
  const complex_t emf = observer->emf_v_q25;
  const complex_t before = observer->voltage_v_q25;
  const int64_t re = product_re(current, gains->phi) + (int64_t)error.re * gains->innovation +
                     product_re(voltage_v_q25, gains->gamma1) + product_re(before, gains->gamma2) +
                     product_re(emf, gains->gamma_e);
  const int64_t im = product_im(current, gains->phi) + (int64_t)error.im * gains->innovation +
                     product_im(voltage_v_q25, gains->gamma1) + product_im(before, gains->gamma2) +
                     product_im(emf, gains->gamma_e);
  observer->current_i_q25 =
      (complex_t){limit_state(round_shift(re, gains->shift)), limit_state(round_shift(im, gains->shift))};
  const complex_t change = complex_gain_apply(error, gains->emf_gain);
  observer->emf_v_q25 =
      (complex_t){limit_state((int64_t)emf.re + change.re), limit_state((int64_t)emf.im + change.im)};
  observer->voltage_v_q25 = voltage_v_q25;
}

HOT void emf_observer_voltage(emf_observer_t *observer, const emf_observer_gains_t *gains, complex_t voltage_v_q25) {
  const complex_t current = observer->current_i_q25;
  const complex_gain_t gamma1 = {gains->gamma1.re, gains->gamma1.im, gains->shift};
  const complex_t change = complex_gain_apply(voltage_v_q25, gamma1);
  observer->current_i_q25 =
      (complex_t){limit_state((int64_t)current.re + change.re), limit_state((int64_t)current.im + change.im)};
  observer->voltage_v_q25 = voltage_v_q25;
}
