// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/torque.h"

#include "control/placement.h"

HOT int32_t torque_reference(int32_t target_i_q25, gain_t kp, int32_t speed_rpm_q8, int32_t low_rpm_q8,
                             int32_t high_rpm_q8, int32_t low_i_q25, int32_t high_i_q25) {
  const int32_t least = gain_apply(low_rpm_q8 - speed_rpm_q8, kp);
  const int32_t most = gain_apply(high_rpm_q8 - speed_rpm_q8, kp);
  return clamp_i32(clamp_i32(target_i_q25, least, most), low_i_q25, high_i_q25);
}
