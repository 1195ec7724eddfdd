// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Speed loop of the vector path: PI on the electrical speed gives the torque-making current, within what the amplitude
// leaves beside i_d.
//
//   i_q = k_p (omega* - omega) + integral + feed-forward,   |i_q| <= sqrt(i_max^2 - i_d^2)
#ifndef FL_VECTOR_SPEED_H
#define FL_VECTOR_SPEED_H

#include <stdint.h>

#include "control/pi.h"

// Largest |i_q| beside i_d; 0 if i_d takes all. About 360 clocks.
int32_t current_rest_i_q25(int32_t amplitude_i_q25, int32_t other_i_q25);

// Continue so that the next step at these speeds gives `current`.
void vector_speed_preset(pi_state_t *state, const pi_gains_t *gains, int32_t reference_turn_q36,
                         int32_t speed_turn_q36, int32_t current_i_q25);

// One step between two limits, low <= 0 <= high within 2^25. Beyond a limit the integral moves only to lead back, so that a speed
// far from its reference leaves no integral to undo; it never holds more than the limits. About 100 clocks.
pi_result_t vector_speed_between(pi_state_t *state, const pi_gains_t *gains, int32_t error_turn_q36,
                                 int32_t ahead_i_q25, int32_t low, int32_t high);

// The same with one limit and back-calculation; gains from a speed difference of 2^-36 turn a clock to a current i_q25; limit_i_q25 >= 0. The side
// on which output and unlimited differ is the limit that binds. About 170 clocks.
pi_result_t vector_speed_step(pi_state_t *state, const pi_gains_t *gains, int32_t reference_turn_q36,
                              int32_t speed_turn_q36, int32_t feed_forward_i_q25, int32_t limit_i_q25);

#endif
