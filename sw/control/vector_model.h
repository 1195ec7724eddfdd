// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Exact discrete model of a synchronous machine in dq at the actual signed speed, for any delay T_d from current sample
// to voltage update, 0 <= T_d <= T_s (Yang 2020, ch. 7, corrected). Voltage latched in the stationary frame, EMF e = j
// psi omega constant in dq:
//
//   i[k+1] = Phi i[k] + Gamma1 u[k] + Gamma2 u[k-1] + Gamma_e e[k]
//   Phi     = exp(-x - j b)                                        x = R T_s / L, b = omega T_s, t = T_d / T_s
//   Gamma1  = c (1-t) f(x (1-t)) exp(-j b)                         f(y) = (1 - exp(-y)) / y
//   Gamma2  = c t f(x t) exp(-x (1-t)) exp(-2 j b)                 c = T_s / L
//   Gamma_e = -c (1 - Phi) / (x + j b)
//
// PARK_HELD: u[k] is transformed with the angle of instant k. PARK_EXACT: with that angle plus the lead omega (T_d +
// T_s/2); Gamma1 and Gamma2 then carry exp(j lead). The delay is contained in the model: nothing else compensates it.
//
// Scaled by full scales V and I, c becomes the admittance T_s V / (L I) from voltage to current of equal fraction bits;
// the Gammas here are in units of it. Subspace 3 of a five-phase machine: its own R and L, harmonic 3.
#ifndef FL_VECTOR_MODEL_H
#define FL_VECTOR_MODEL_H

#include <stdint.h>

#include "control/complex_fixed.h"
#include "control/fixed.h"

typedef enum { PARK_HELD, PARK_EXACT } park_t;

// One subspace of the machine as the parameter block gives it.
typedef struct {
  uint32_t resistance_q30;  // x = R T_s / L, below 2
  uint32_t delay_q30;       // t = T_d / T_s, 0..1
  gain_t admittance;        // T_s V / (L I)
  gain_t impedance;         // its reciprocal
  uint32_t period_cycles;   // T_s, 1..65535
  uint32_t harmonic;        // 1, or 3: turns of the subspace a turn of the rotor
  park_t park;
} vector_machine_t;

// What does not depend on the speed.
typedef struct {
  vector_machine_t machine;
  int32_t factor_q30;  // exp(-x)
  int32_t share_q30;   // f(x (1-t))
  int32_t held_q30;    // t f(x t) exp(-x (1-t))
} vector_plant_t;

// Dimensionless, Gammas in units of the admittance; all parts within +-1.
typedef struct {
  complex_t phi_q30;
  complex_t gamma1_q30;
  complex_t gamma1_share_q30;  // Gamma1 / (1 - t), finite at t = 1
  complex_t gamma2_q30;
  complex_t gamma_e_q30;
  int32_t turn_rad_q29;  // b, of one period
} vector_model_t;

// Prepare; again when period or delay changes. About 680 clocks.
void vector_plant(vector_plant_t *plant, const vector_machine_t *machine);

// Angle in a sample period, 2^32 = one turn, saturated at half a turn either way. About 40 clocks.
int32_t vector_turn_q32(const vector_machine_t *machine, int32_t speed_turn_q36);

// From the sample to the middle of the time in which its voltage acts: omega (T_d + T_s/2), modulo a turn. About 70
// clocks.
int32_t vector_action_turn_q32(const vector_machine_t *machine, int32_t speed_turn_q36);

// Advance of the inverse Park: that angle; 0 for PARK_HELD.
int32_t vector_lead_turn_q32(const vector_machine_t *machine, int32_t speed_turn_q36);

// The model at a signed electrical speed in 2^-36 turn a clock, below half a turn of the subspace a period. Error
// below 1e-8 of 1, 4e-8 for Gamma_e. About 1400 clocks: not at every sample.
void vector_model(vector_model_t *model, const vector_plant_t *plant, int32_t speed_turn_q36);

// Model of n = 1..255 periods with a constant voltage, from that of one; Gammas in units of n admittances:
//
//   Phi' = Phi^n, S = (1 + Phi + ... + Phi^(n-1)) / n
//   Gamma1' = S (Gamma1 + Gamma2) - Phi^(n-1) Gamma2 / n, Gamma2' = Phi^(n-1) Gamma2 / n, Gamma_e' = S Gamma_e
//
// The voltage before the n periods counts in Gamma2'. About 250 n + 350 clocks.
void vector_model_join(vector_model_t *model, uint32_t periods);

// The machine in units for the joined model: period times n, admittance times n, impedance over n.
void vector_machine_join(vector_machine_t *machine, uint32_t periods);

#endif
