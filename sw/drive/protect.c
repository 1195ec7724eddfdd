// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "drive/protect.h"

#include "control/fixed.h"
#include "control/placement.h"

// A hundredth of the converter's range.
#define UNPOWERED_Q17 1311
// Fewer equal values in a row noise gives by itself, once in a long time.
#define STILL_LOOKS_MIN 12u

static bool silent(const drive_t *drive) {
  const uint32_t limit = drive->settings.command_timeout_ticks;
  const bool active = drive->state == STATE_STARTING || drive->state == STATE_RUNNING || drive->state == STATE_STOPPING;
  return limit > 0u && active && drive->tick - drive->heard_tick > limit;
}

// Several at once: the first of them has the name, a silent console the last.
COLD bool protect_step(drive_t *drive, const chip_snapshot_t *in, int32_t current_i_q17, uint32_t ticks) {
  protect_t *t = &drive->protect;
  const parameters_t *p = drive->p;
  // The winding cools in every state.
  const overload_settings_t overload = {p->rated_i_q17, (uint32_t)p->overload_ticks};
  fault_t fault = overload_step(&t->overload, &overload, current_i_q17, ticks) ? FAULT_OVERLOAD : FAULT_NONE;
  if (drive->state == STATE_INIT || drive->state == STATE_FAULT) {
    t->sum = (sum_t){0};
    t->still = (still_t){0};
    return false;
  }
  int32_t seen_q17[STILL_CHANNELS_MAX];
  int32_t sum_i_q17 = 0;
  for (uint32_t x = 0; x < PHASES; x++) {
    sum_i_q17 += in->i_q17[x];
  }
  if (sum_step(&t->sum, sum_i_q17, p->sum_limit_q17) && fault == FAULT_NONE) {
    fault = FAULT_CURRENT_SUM;
  }
  seen_q17[0] = drive->m.idc_mean_q17;
  // Without a supply there is nothing to see: noise below zero is cut off.
  const int32_t vdc_q17 = drive->m.vdc_v_q25 >> 8;
  const bool powered = vdc_q17 > UNPOWERED_Q17;
  seen_q17[1] = powered ? vdc_q17 : (int32_t)t->still.last[1] + 1;
  const uint32_t wanted = (uint32_t)p->still_ticks / ticks;
  const uint32_t looks = (wanted > 0u && wanted < STILL_LOOKS_MIN) ? STILL_LOOKS_MIN : wanted;
  const bool still = in->sum_count > 0u && still_step(&t->still, seen_q17, STILL_CHANNELS_MAX, looks);
  if (still && fault == FAULT_NONE) {
    fault = FAULT_STUCK_CHANNEL;
  }
  if (silent(drive) && fault == FAULT_NONE) {
    fault = FAULT_COMMAND_TIMEOUT;
  }
  if (fault != FAULT_NONE) {
    drive_enter_fault(drive, fault);
  }
  return fault != FAULT_NONE;
}
