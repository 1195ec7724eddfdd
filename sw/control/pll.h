// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Phase-locked loop on the observed EMF: angle, speed and, third order, acceleration of the rotor.
//
//   eps = -sgn(omega) e_gamma / |e| = sin(theta - theta^)    beyond 90 degrees +-1, so that it does not fade at 180
//   theta^[k+1] = theta^[k] + omega[k] T_s + k_p eps
//   omega[k+1] = omega[k] + a[k] + k_i eps,   a[k+1] = a[k] + k_a eps
//
// eps in radians for small errors, k_i and k_a for omega T_s. All poles at p, q = 1 - p: second order k_p = 2 q,
// k_i = q^2, k_a = 0; third order k_p = 3 q, k_i = 3 q^2, k_a = q^3. Second order lags by a / k_i while accelerating,
// third order does not. Without the sign of the speed the point of lock would be the unstable one in reverse.
//
// The step of the angle is what the hardware's accumulator makes of the same speed, bit for bit.
#ifndef FL_PLL_H
#define FL_PLL_H

#include <stdint.h>

#include "control/complex_fixed.h"
#include "control/fixed.h"

typedef struct {
  uint64_t angle_turn_q36;         // modulo 2^36
  int64_t speed_turn_q60;          // a clock
  int64_t acceleration_turn_q60;   // change of the speed a sample
} pll_t;

typedef struct {
  gain_t angle;                // k_p 2^32 / (2 pi 2^30): eps_q30 -> 2^-32 turn
  gain_t speed;                // k_i 2^60 / (2 pi N 2^30), N clocks a sample: eps_q30 -> 2^-60 turn a clock
  gain_t acceleration;         // k_a likewise; mant 0: second order
  int32_t speed_max_turn_q36;  // |speed| is held within, > 0
} pll_gains_t;

// eps from the EMF in the estimated frame, for the sign of the estimated speed; 0 below an amplitude of minimum > 0.
// Scale within 2e-4. About 80 clocks below 11 degrees, else 360.
int32_t pll_error_q30(complex_t emf_v_q25, int32_t speed_turn_q36, uint32_t minimum_v_q25);

// The same without a division where |e| has hardly changed: keeps its reciprocal, 0 at first.
int32_t pll_error_from_q30(complex_t emf_v_q25, int32_t speed_turn_q36, uint32_t minimum_v_q25, uint32_t *reciprocal);

// Start at an angle and a speed.
void pll_preset(pll_t *pll, uint32_t angle_turn_q32, int32_t speed_turn_q36);

uint32_t pll_angle_turn_q32(const pll_t *pll);

int32_t pll_speed_turn_q36(const pll_t *pll);

// Speed and acceleration from one sample to the next, |error| <= 1. Returns the correction of the angle by k_p, 2^-32
// turn, for who keeps the angle elsewhere. About 80 clocks.
int32_t pll_correct(pll_t *pll, const pll_gains_t *gains, int32_t error_q30);

// From one sample to the next, with the angle. Returns the correction of the angle by k_p, 2^-32 turn. About 110 clocks.
int32_t pll_step(pll_t *pll, const pll_gains_t *gains, uint32_t period_cycles, int32_t error_q30);

#endif
