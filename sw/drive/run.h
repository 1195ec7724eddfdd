// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Regulation while the crossings commutate.
//
// Straight to the voltage:
//   u = k_e n_ref + Kp a_ref/w_b + PI(n_ref - n),   Kp = J R(n) w_b / k_t,  Ki = max(k_e w_b, Kp w_b / 5)
// With current loop:
//   i_ref = J a_ref / k_t + PI(n_ref - n),          Kp = J w_b / k_t,       Ki = Kp w_b / 5;  torque mode: i_ref given
//   u = k_e n + R(n) i_ref + PI(i_ref - i),         Kp = L w_c,             Ki = R(n) w_c
//
// R(n) is the line resistance plus the commutation drop 3/pi*omega_e*L. The gains of the speed regulators shrink at
// speeds whose electrical turn is long against 1/w_b: the speed is a mean over that turn.
#ifndef FL_RUN_H
#define FL_RUN_H

#include "drive/drive.h"

#define RUN_PREPARE_TICKS 8u

// Schedule gains, one group a tick: for at least RUN_PREPARE_TICKS before run_begin.
void run_prepare(drive_t *drive);

// Enter STATE_RUNNING without a step of the voltage.
void run_begin(drive_t *drive);

// One step toward a target (magnitude). About 1300 clocks with what it calls.
void run_step(drive_t *drive, int32_t target_rpm_q8);

#endif
