#include "control/pi.h"

static int64_t limit_integral(int64_t integral_q16) {
  const int64_t rail = (int64_t)INT32_MAX << 16;
  if (integral_q16 > rail) {
    return rail;
  }
  return (integral_q16 < -rail) ? -rail : integral_q16;
}

void pi_preset(pi_state_t *state, gain_t kp, int32_t error, int32_t feed_forward, int32_t output) {
  const int64_t rest = (int64_t)output - feed_forward - gain_apply(error, kp);
  state->integral_q16 = limit_integral(rest * 65536);
}

pi_result_t pi_step(pi_state_t *state, pi_gains_t gains, int32_t error, int32_t feed_forward, int32_t low,
                    int32_t high) {
  const int64_t proportional = gain_apply(error, gains.kp);
  const int32_t integral = (int32_t)round_shift(state->integral_q16, 16);
  pi_result_t result;
  result.unlimited = sat_i32((int64_t)feed_forward + proportional + integral);
  result.output = clamp_i32(result.unlimited, low, high);
  const int64_t excess = (int64_t)result.output - result.unlimited;
  const int64_t change = gain_apply(error, gains.ki) + excess * (65536 >> PI_ANTI_WINDUP_SHIFT);
  state->integral_q16 = limit_integral(state->integral_q16 + change);
  return result;
}
