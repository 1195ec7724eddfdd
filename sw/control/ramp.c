#include "control/ramp.h"

#define Q8_TO_Q24 65536

void ramp_preset(ramp_t *ramp, int32_t value_rpm_q8) { ramp->value_rpm_q24 = (int64_t)value_rpm_q8 * Q8_TO_Q24; }

int32_t ramp_value(const ramp_t *ramp) { return (int32_t)(ramp->value_rpm_q24 >> 16); }

int32_t ramp_step(ramp_t *ramp, int32_t target_rpm_q8, int32_t step_rpm_q24, int32_t measured_rpm_q8,
                  int32_t window_rpm_q8) {
  const int64_t target = (int64_t)target_rpm_q8 * Q8_TO_Q24;
  const int64_t old = ramp->value_rpm_q24;
  int64_t next = target;
  if (target > old) {
    const int64_t highest = ((int64_t)measured_rpm_q8 + window_rpm_q8) * Q8_TO_Q24;
    next = (target > old + step_rpm_q24) ? old + step_rpm_q24 : target;
    if (next > highest) {
      next = (old > highest) ? old : highest;
    }
  } else if (target < old) {
    const int64_t lowest = ((int64_t)measured_rpm_q8 - window_rpm_q8) * Q8_TO_Q24;
    next = (target < old - step_rpm_q24) ? old - step_rpm_q24 : target;
    if (next < lowest) {
      next = (old < lowest) ? old : lowest;
    }
  }
  ramp->value_rpm_q24 = next;
  return (next > old) - (next < old);
}
