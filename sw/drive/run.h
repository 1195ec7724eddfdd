// Speed control while the crossings commutate.
//
//   u = k_e n_ref + Kp a_ref/w_b + PI(n_ref - n),   Kp = J R(n) w_b / k_t,  Ki = max(k_e w_b, Kp w_b / 5)
//
// R(n) is the line resistance plus the commutation drop 3/pi*omega_e*L, so that Kp follows the speed. Both gains
// shrink at speeds whose electrical turn is long against 1/w_b: the speed is a mean over that turn.
#ifndef FL_RUN_H
#define FL_RUN_H

#include "drive/drive.h"

// Enter STATE_RUNNING without a step of the voltage.
void run_begin(drive_t *drive);

// One step toward a target (magnitude). About 1300 clocks with what it calls.
void run_step(drive_t *drive, int32_t target_rpm_q8);

#endif
