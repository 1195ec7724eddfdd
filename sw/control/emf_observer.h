// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// EMF observer in the estimated frame (gamma, delta), for any delay from sample to voltage (Yang 2020, ch. 7):
//
//   i^[k+1] = Phi i^[k] + Gamma1 u[k] + Gamma2 u[k-1] + Gamma_e e^[k] + G1 (i[k] - i^[k])
//   e^[k+1] = e^[k] + G2 (i[k] - i^[k])
//   G1 = 1 + Phi - p1 - p2,   G2 = (1 - p1) (1 - p2) / Gamma_e        poles p1, p2 of the error at any signed speed
//
// Computed as i^[k+1] = Phi i[k] + (1 - p1 - p2) (i[k] - i^[k]) + ...: the same, with a real factor. Products count
// by their upper 32 bits, of operands with two to five bits below q25. The angle of e^ against +j sgn(omega) is the error of the estimated
// angle (pll.h).
//
// Coefficients of another speed omega_d than the frame's omega: exp(-j (omega - omega_d) T) is missing in Phi i[k], and
// L (omega - omega_d) i counts as an EMF across the one there is. The step turns i[k] by that drift. In the voltages it
// hardly counts: u[k-1] and e^ turn by nearly the same angle and nearly cancel.
#ifndef FL_EMF_OBSERVER_H
#define FL_EMF_OBSERVER_H

#include <stdbool.h>
#include <stdint.h>

#include "control/complex_fixed.h"
#include "control/vector_model.h"

typedef struct {
  complex_t current_i_q25;
  complex_t emf_v_q25;
  complex_t voltage_v_q25;  // u[k-1]
} emf_observer_t;

// Gammas from voltage to current of equal fraction bits. The shifts are what is left after the upper halves of the
// products, either sign.
typedef struct {
  complex_t phi_q30;
  complex_t gamma1;
  complex_t gamma2;
  complex_t gamma_e;
  int32_t innovation_q30;  // 1 - p1 - p2
  int32_t shift;  // of the Gammas
  complex_t emf_gain;  // G2
  int32_t emf_shift;
  int32_t emf_bits;  // below q25, of the EMF
  bool wide;  // a shift goes the other way
} emf_observer_gains_t;

// Gains at the speed of the model; poles 0..1. They keep 24 bits up to an admittance of 64. About 1150 clocks: not at
// every sample.
void emf_observer_design(emf_observer_gains_t *gains, const vector_machine_t *machine, const vector_model_t *model,
                         int32_t pole1_q30, int32_t pole2_q30);

// Start with the measured current, the EMF that is known and the last voltage.
void emf_observer_preset(emf_observer_t *observer, complex_t current_i_q17, complex_t emf_v_q25,
                         complex_t voltage_v_q25);

// Go over to a frame turned by -arg(rotation): the vectors stay where they are in the machine. About 270 clocks.
void emf_observer_turn(emf_observer_t *observer, complex_t rotation_q30);

// The same by a small angle to the first order: all three vectors grow by half its square, 3e-4 at 1.4 degrees. About 60
// clocks.
void emf_observer_turn_small(emf_observer_t *observer, int32_t turn_rad_q32);

// One sample: current i[k] in the estimated frame of this instant. The current saturates at four full scales, the EMF at
// eight, at two from an admittance of 1 on. drift: turn of the frame until the next sample beyond the coefficients' own,
// within 2^-4 rad. About 120 clocks.
void emf_observer_step(emf_observer_t *observer, const emf_observer_gains_t *gains, complex_t current_i_q17,
                       int32_t drift_rad_q32);

// The voltage u[k], |u| at most 1.4 full scales, set in answer to the sample of the last step; before the next step, in
// the frame of the last one. It may come when its period is over. About 30 clocks.
void emf_observer_voltage(emf_observer_t *observer, const emf_observer_gains_t *gains, complex_t voltage_v_q25);

#endif
