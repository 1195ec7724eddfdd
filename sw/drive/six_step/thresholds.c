// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "drive/six_step/thresholds.h"

#include "control/placement.h"

// An interval spans two crossings: after a change of the thresholds the first one is a mixed one.
#define CROSSINGS_A_TURN 7u
// Largest change of the electrical period from turn to turn, as a power of two of it.
#define STEADY_SHIFT 7

// 0.15 of the link voltage.
#define BALANCE_LIMIT_Q25 5033165

typedef enum { STAGE_WAIT, STAGE_ERRORS, STAGE_GAIN, STAGE_STEP, STAGE_WRITE } stage_t;

static void set_thresholds(const thresholds_t *t, threshold_command_t *command, const parameters_t *p) {
  for (uint32_t sector = 0; sector < SECTORS; sector++) {
    command->q17[sector] = balance_threshold_q17(&t->balance, sector, p->zcd_threshold_q17[sector]);
  }
  command->fresh = true;
}

static void wait_for_turn(thresholds_t *t, const measured_t *m) {
  t->stage = STAGE_WAIT;
  t->turn_from = m->crossings;
}

COLD void thresholds_reset(thresholds_t *t, threshold_command_t *command, const parameters_t *p) {
  *t = (thresholds_t){.stage = STAGE_WAIT};
  set_thresholds(t, command, p);
}

// True: this turn's intervals mean something.
static bool steady(thresholds_t *t, const chip_snapshot_t *in) {
  const uint32_t period = in->zc_period_cycles;
  const uint32_t change = (period > t->period_cycles) ? period - t->period_cycles : t->period_cycles - period;
  const bool calm = change <= period >> STEADY_SHIFT && in->late == t->late && in->timeouts == t->timeouts;
  t->period_cycles = period;
  t->late = in->late;
  t->timeouts = in->timeouts;
  return calm;
}

// Gain for this speed: proportional to the EMF, less on turns that are long against the bandwidth.
static gain_t step_gain(const thresholds_t *t, const six_step_view_t *view, uint8_t source) {
  const parameters_t *p = view->p;
  const uint32_t emf = (uint32_t)clamp_i32(view->m->emf_v_q25, 0, view->m->vdc_v_q25);
  const uint32_t vdc = (uint32_t)view->m->vdc_v_q25 >> 9;
  uint32_t share_q16 = (vdc > 0u) ? clamp_u32(((emf >> 9) << 15) / vdc, 0, 32768u) << 1 : 0u;
  const uint32_t most = (uint32_t)p->balance_turn_cycles >> 8;
  const uint32_t turn = t->period_cycles >> 8;
  if (turn > most) {
    share_q16 = (share_q16 >> 1) * clamp_u32(most, 0, 65535u) / turn << 1;
  }
  if (source != ZCD_SOURCE_TERMINAL) {
    share_q16 /= 3u;  // slope of the third harmonic
  }
  return (gain_t){mul_q16(p->balance_step.mant, (int32_t)share_q16), p->balance_step.shift};
}

SMALL_CODE_BEGIN
COLD static void thresholds_stage(thresholds_t *t, threshold_command_t *command, const six_step_view_t *view,
                                  bool reverse, uint8_t source) {
  switch (t->stage) {
    case STAGE_ERRORS:
      balance_errors(view->in->sector_interval_cycles, reverse, t->error_x6);
      t->stage = STAGE_GAIN;
      if (!steady(t, view->in)) {
        wait_for_turn(t, view->m);
      }
      break;
    case STAGE_GAIN:
      t->gain = step_gain(t, view, source);
      t->stage = STAGE_STEP;
      break;
    case STAGE_STEP:
      balance_step(&t->balance, view->settings->balance, t->error_x6, t->gain, BALANCE_LIMIT_Q25);
      t->stage = STAGE_WRITE;
      break;
    case STAGE_WRITE:
      set_thresholds(t, command, view->p);
      // In force from the next tick on.
      wait_for_turn(t, view->m);
      break;
    default:
      wait_for_turn(t, view->m);
      break;
  }
}
SMALL_CODE_END

HOT void thresholds_step(thresholds_t *t, threshold_command_t *command, const six_step_view_t *view, bool reverse,
                         uint8_t source) {
  const settings_t *settings = view->settings;
  command->read = false;
  t->busy = t->stage != STAGE_WAIT;
  if (settings->balance != t->mode) {
    t->mode = settings->balance;
    if (t->mode == BALANCE_NONE) {
      thresholds_reset(t, command, view->p);
      return;
    }
  }
  if (t->mode == BALANCE_NONE || settings->freeze) {
    return;
  }
  if (t->stage != STAGE_WAIT) {
    thresholds_stage(t, command, view, reverse, source);
  } else if (view->m->crossings - t->turn_from > CROSSINGS_A_TURN) {
    command->read = true;
    t->stage = STAGE_ERRORS;
  }
}
