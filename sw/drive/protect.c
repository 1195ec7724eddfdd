// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "drive/protect.h"

#include "control/fixed.h"
#include "control/placement.h"

// A hundredth of the converter's range.
#define UNPOWERED_Q17 1311
// Fewer equal values in a row noise gives by itself, once in a long time.
#define STILL_LOOKS_MIN 12u

// A stop that does not slow the rotor opens the gates: one that makes it faster is a fault, else the log names it. Where
// crossings give the speed, a look without a new one shows the old speed and does not count.
COLD static outcome_t judge_stop(protect_t *protect, const parameters_t *p, const order_t *order, const report_t *report,
                                 uint32_t ticks) {
  if (order->state != STATE_STOPPING) {
    slowing_begin(&protect->slowing, report->speed_rpm_q8);
    return outcome_of(EVENT_STAY);
  }
  const bool old = report->crossings != 0u && report->crossings == protect->crossings;
  protect->crossings = report->crossings;
  const slowing_verdict_t verdict = slowing_step(&protect->slowing, report->speed_rpm_q8, report->demand_rpm_q8,
                                                 old ? 0u : ticks, (uint32_t)p->stop_patience_ticks);
  if (verdict == SLOWING_YES) {
    return outcome_of(EVENT_STAY);
  }
  return (verdict == SLOWING_FASTER) ? outcome_fault(FAULT_STOP_FAILED)
                                     : outcome_passing(outcome_of(EVENT_STOPPED), FAULT_STOP_FAILED);
}

// Several at once: the first of them has the name, a silent console the last.
COLD outcome_t protect_step(protect_t *protect, const parameters_t *p, const chip_snapshot_t *in, const order_t *order,
                            const settings_t *settings, const report_t *report, uint32_t ticks, uint32_t silent_ticks) {
  // The winding cools in every state.
  const overload_settings_t overload = {p->rated_i_q17, (uint32_t)p->overload_ticks};
  const bool hot = overload_step(&protect->overload, &overload, report->machine_i_q17, ticks);
  fault_t fault = hot ? FAULT_OVERLOAD : FAULT_NONE;
  if (order->state == STATE_INIT || order->state == STATE_FAULT) {
    protect->sum = (sum_t){0};
    protect->still = (still_t){0};
    return outcome_of(EVENT_STAY);
  }
  int32_t seen_q17[STILL_CHANNELS_MAX];
  int32_t sum_i_q17 = 0;
  for (uint32_t x = 0; x < PHASES; x++) {
    sum_i_q17 += in->i_q17[x];
  }
  if (sum_step(&protect->sum, sum_i_q17, p->sum_limit_q17) && fault == FAULT_NONE) {
    fault = FAULT_CURRENT_SUM;
  }
  seen_q17[0] = report->idc_mean_q17;
  // Without a supply there is nothing to see: noise below zero is cut off.
  const int32_t vdc_q17 = report->vdc_v_q25 >> 8;
  const bool powered = vdc_q17 > UNPOWERED_Q17;
  seen_q17[1] = powered ? vdc_q17 : (int32_t)protect->still.last[1] + 1;
  const uint32_t wanted = (uint32_t)p->still_ticks / ticks;
  const uint32_t looks = (wanted > 0u && wanted < STILL_LOOKS_MIN) ? STILL_LOOKS_MIN : wanted;
  const bool still = in->sum_count > 0u && still_step(&protect->still, seen_q17, STILL_CHANNELS_MAX, looks);
  if (still && fault == FAULT_NONE) {
    fault = FAULT_STUCK_CHANNEL;
  }
  const uint32_t patience_ticks = settings->command_timeout_ticks;
  const bool silent = patience_ticks > 0u && order_active(order) && silent_ticks > patience_ticks;
  if (silent && fault == FAULT_NONE) {
    fault = FAULT_COMMAND_TIMEOUT;
  }
  return (fault != FAULT_NONE) ? outcome_fault(fault) : judge_stop(protect, p, order, report, ticks);
}
