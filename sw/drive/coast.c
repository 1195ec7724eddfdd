// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "drive/coast.h"

#include "control/fixed.h"
#include "control/placement.h"

#define CALM_TICKS 8u
#define PAIR_EMF_SHIFT 3
#define DOUBLINGS_MAX 4u
#define CATCH_FAILURES_MAX 2u
// 40 codes of 12 bits: far above noise.
#define EMF_SEEN_Q17 1280

SMALL_CODE_BEGIN
void coast_begin(coast_t *coast) {
  catch_reset(&coast->rotor);
  stuck_reset(&coast->stuck);
  winding_reset(&coast->winding);
  coast->verdict = WINDING_UNKNOWN;
  coast->calm_ticks = 0;
}

void coast_see(coast_t *coast, const parameters_t *p, const chip_snapshot_t *in) {
  coast->line_emf_q17 = catch_restore(in->v_q17, p->diode_v_q25 / 256, coast->v_q17);
  const int32_t apart_q17 = coast->line_emf_q17 - coast->pair_emf_q17;
  coast->pair_emf_q17 += (coast->rotor.agreeing > 0u) ? apart_q17 >> PAIR_EMF_SHIFT : apart_q17;
}

winding_verdict_t coast_winding(coast_t *coast, const order_t *order) {
  // Of five phases the lines of three are never alike.
  if (PHASES != 3 || !order->suspected || coast->line_emf_q17 < EMF_SEEN_Q17) {
    return WINDING_WHOLE;
  }
  if (coast->verdict == WINDING_UNKNOWN && order->state_ticks > COAST_SETTLE_TICKS) {
    coast->verdict = winding_step(&coast->winding, coast->v_q17, EMF_SEEN_Q17 / 2);
  }
  return coast->verdict;
}

bool coast_may_catch(const order_t *order, const settings_t *settings) {
  return settings->catch && (order->failed_starts < CATCH_FAILURES_MAX || order->pulled_out);
}

// The amplitude of the EMF belongs to the speed at which its angle turns, to 30 %, for a flux that is a fifth off: all three
// channels measure.
static bool plausible(const coast_t *coast, const parameters_t *p) {
  const int32_t emf_q17 = gain_apply(coast->speed_rpm_q8, p->emf) / 256;
  return abs_sat(coast->line_emf_q17 - emf_q17) < emf_q17 / 10 * 3;
}

bool coast_caught(coast_t *coast, const parameters_t *p, const order_t *order, const settings_t *settings,
                  int32_t vdc_v_q25) {
  if (!coast_may_catch(order, settings) || coast->line_emf_q17 < p->catch_v_q17) {
    catch_reset(&coast->rotor);
    return false;
  }
  if (!catch_step(&coast->rotor, coast->v_q17, &coast->mean_step_q32)) {
    return false;
  }
  coast->speed_rpm_q8 = gain_apply(abs_sat(coast->mean_step_q32) / 256, p->catch_speed);
  return plausible(coast, p) && coast->speed_rpm_q8 / 256 <= p->overspeed_rpm && vdc_v_q25 != 0;
}

uint32_t coast_calm_ticks(const order_t *order) {
  return CALM_TICKS << clamp_u32(order->failed_starts, 0, DOUBLINGS_MAX);
}

bool coast_calm(coast_t *coast, const parameters_t *p, const order_t *order) {
  coast->calm_ticks = (coast->line_emf_q17 < p->coast_v_q17) ? coast->calm_ticks + 1u : 0u;
  return coast->calm_ticks >= coast_calm_ticks(order);
}

bool coast_stuck(coast_t *coast, const parameters_t *p, const chip_snapshot_t *in) {
  return stuck_step(&coast->stuck, in->v_q17, coast->line_emf_q17 >= p->catch_v_q17, (uint32_t)p->stuck_ticks);
}

coast_result_t coast_judge(coast_t *coast, const parameters_t *p, const order_t *order, bool calm, int32_t vdc_v_q25) {
  const int32_t vdc_q17 = vdc_v_q25 / 256;
  coast->fault = FAULT_NONE;
  if (!calm) {
    coast->fault = (order->state_ticks > (uint32_t)p->coast_timeout_ticks) ? FAULT_ROTOR_SPINNING : FAULT_NONE;
  } else if (vdc_q17 < p->vdc_min_q17) {
    coast->fault = FAULT_UNDER_VOLTAGE;
  } else if (vdc_q17 > p->vdc_max_q17) {
    coast->fault = FAULT_OVER_VOLTAGE;
  }
  if (coast->fault != FAULT_NONE) {
    return COAST_FAULT;
  }
  return calm ? COAST_AT_REST : COAST_WAIT;
}

SMALL_CODE_END
