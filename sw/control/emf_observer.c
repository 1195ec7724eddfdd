#include "control/emf_observer.h"

#include "control/placement.h"

#define STATE_MAX PRODUCT_MAX

static complex_t limit_state(complex_t z) {
  return (complex_t){clamp_i32(z.re, -STATE_MAX, STATE_MAX), clamp_i32(z.im, -STATE_MAX, STATE_MAX)};
}

static complex_t current_q25(complex_t current_i_q17) {
  return (complex_t){current_i_q17.re * 256, current_i_q17.im * 256};
}

void emf_observer_design(emf_observer_gains_t *gains, const vector_machine_t *machine, const vector_model_t *model,
                         int32_t pole1_q30, int32_t pole2_q30) {
  const complex_gain_t inverse = complex_inverse(model->gamma_e_q30);
  const complex_gain_t impedance = {machine->impedance.mant, 0, 31};
  const complex_t scaled = complex_gain_apply((complex_t){inverse.re, inverse.im}, impedance);
  const int64_t product = (int64_t)(ONE_Q30 - pole1_q30) * (ONE_Q30 - pole2_q30);
  const complex_t g2 = complex_scale_q30(scaled, (int32_t)round_shift(product, 30));
  gains->model = *model;
  gains->admittance = machine->admittance;
  gains->innovation_q30 = ONE_Q30 - pole1_q30 - pole2_q30;
  gains->emf_gain = (complex_gain_t){g2.re, g2.im, inverse.shift - 30 + machine->impedance.shift - 31};
}

void emf_observer_preset(emf_observer_t *observer, complex_t current_i_q17, complex_t emf_v_q25,
                         complex_t voltage_v_q25) {
  observer->current_i_q25 = current_q25(current_i_q17);
  observer->emf_v_q25 = emf_v_q25;
  observer->voltage_v_q25 = voltage_v_q25;
}

void emf_observer_turn(emf_observer_t *observer, complex_t rotation_q30) {
  observer->current_i_q25 = complex_mul_q30(observer->current_i_q25, rotation_q30);
  observer->emf_v_q25 = complex_mul_q30(observer->emf_v_q25, rotation_q30);
  observer->voltage_v_q25 = complex_mul_q30(observer->voltage_v_q25, rotation_q30);
}

HOT void emf_observer_step(emf_observer_t *observer, const emf_observer_gains_t *gains, complex_t current_i_q17,
                           complex_t voltage_v_q25) {
  const vector_model_t *model = &gains->model;
  const complex_t current = current_q25(current_i_q17);
  const complex_t error = complex_sub(current, observer->current_i_q25);
  complex_t drive = complex_mul_q30(voltage_v_q25, model->gamma1_q30);
  drive = complex_add(drive, complex_mul_q30(observer->voltage_v_q25, model->gamma2_q30));
  drive = complex_add(drive, complex_mul_q30(observer->emf_v_q25, model->gamma_e_q30));
  complex_t next = complex_mul_q30(current, model->phi_q30);
  next = complex_add(next, complex_scale_q30(error, gains->innovation_q30));
  next = complex_add(next, (complex_t){gain_apply(drive.re, gains->admittance),
                                       gain_apply(drive.im, gains->admittance)});
  observer->current_i_q25 = limit_state(next);
  const complex_t correction = limit_state(complex_gain_apply(error, gains->emf_gain));
  observer->emf_v_q25 = limit_state(complex_add(observer->emf_v_q25, correction));
  observer->voltage_v_q25 = voltage_v_q25;
}
