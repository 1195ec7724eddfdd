// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Open phases of a machine held by injection and EMF.
//
// Five phases, one of them open, k: i_k = 0 couples the subspaces. The regulators of subspace 1 hold its current as it
// was, the torque stays even; that of subspace 3 along the open phase's axis is then - Re(i_1 exp(-j k 72 deg)), and across
// it 0 costs least. With no voltage of its own subspace 3 comes to that by itself: what the open phase adds to the voltage
// drives it along that axis only. Phases beside the open one then carry 1.468 times the amplitude of subspace 1, the two
// others 1.263 times: the limit of the current goes to 1 / 1.468.
//
// The saliency of four phases turns with the rotor: the injection finds no angle.
#include "control/fixed.h"
#include "control/placement.h"
#include "control/plausible.h"
#include "drive/vector/injected.h"
#include "drive/vector/current.h"
#include "drive/vector/parts.h"

#define SHARE_Q16 9830u               // 0.15 of the amplitude
#define TURN_Q32 1431655765u          // 120 degrees; a sound phase is quiet for 17, with dead time and no wave for 60 and more
#define LEAST_SHIFT 3                 // amplitude below an eighth of the limit: nothing is judged
#define FOUR_PHASES_Q16 44642         // 1 / 1.468

SMALL_CODE_BEGIN

COLD static bool several(uint32_t phases) { return (phases & (phases - 1u)) != 0u; }

COLD static outcome_t stop(const vector_t *v) {
  return outcome_fault(several(v->injection->open.open) ? FAULT_OPEN_PHASES : FAULT_OPEN_PHASE);
}

// The state of subspace 3 is its preset one from now on: none.
COLD static outcome_t found(vector_t *v) {
  const injection_handover_t *handover = &v->injection->frame.handover;
  const bool by_emf = handover->emf && !handover->inject;
  if (PHASES != 5 || !by_emf || several(v->injection->open.open)) {
    return stop(v);
  }
  current_preset(&v->command, 1, (complex_t){0, 0});
  return outcome_passing(outcome_of(EVENT_STAY), FAULT_OPEN_PHASE);
}

static sum_t sum;  // of the currents of five phases

// The slow protection looks once in 64 ticks, 8 ms at 4 kHz: a small current that a sensor does not see would pass it by.
INLINED static bool torn(vector_t *v, const chip_snapshot_t *in) {
  int32_t sum_i_q17 = 0;
  for (uint32_t k = 0; k < PHASES; k++) {
    sum_i_q17 += in->i_q17[k];
  }
  return PHASES == 5 && sum_step(&sum, sum_i_q17, v->p->sum_limit_q17);
}

COLD void vector_open_phase_listen(vector_t *v, const chip_snapshot_t *in) {
  if (vector_open_phase_listens(v) && v->command.look.slow && v->command.look.currents) {
    open_phase_note(&v->injection->open, in->i_q17, PHASES, v->injection->frame.rest.phase);
  }
}

HOT outcome_t vector_open_phase_step(vector_t *v, const chip_snapshot_t *in) {
  vector_injection_t *j = v->injection;
  if (torn(v, in)) {
    return outcome_fault(FAULT_CURRENT_SUM);
  }
  if (j->frame.resting) {
    // The frame turns, not the rotor: the search's two waves tell.
    const bool told = !vector_open_phase_listens(v) && j->frame.rest.phase != REST_NO_SIGNAL;
    return (told && open_phase_judge(&j->open, PHASES) != 0u) ? stop(v) : outcome_of(EVENT_STAY);
  }
  const open_phase_settings_t settings = {
      .share_q16 = SHARE_Q16,
      .minimum_i_q17 = (uint32_t)v->settings->current_limit_q17 >> LEAST_SHIFT,
      .turn_q32 = TURN_Q32,
  };
  const uint32_t before = j->open.open;
  const uint32_t amplitude_i_q17 = rough_length(v->report.vector.current_i_q17);
  const uint32_t now = open_phase_step(&j->open, &settings, in->i_q17, PHASES, amplitude_i_q17, v->report.vector.angle_turn_q32);
  if (now != before) {
    return found(v);
  }
  if (now != 0u && j->command.inject) {
    // The speed has come down to where there is no angle any more.
    return (v->order->state == STATE_STOPPING) ? outcome_of(EVENT_STOPPED) : stop(v);
  }
  return outcome_of(EVENT_STAY);
}

COLD outcome_t vector_open_phase_refuses(vector_t *v) {
  vector_injection_t *j = v->injection;
  const outcome_t outcome = (j->open.open != 0u) ? stop(v) : outcome_of(EVENT_STAY);
  open_phase_begin(&j->open);
  if (PHASES == 5) {
    sum = (sum_t){0};
  }
  return outcome;
}

HOT int32_t vector_open_phase_limit_i_q25(const vector_t *v) {
  const int32_t limit_i_q25 = v->settings->current_limit_q17 * 256;
  return (v->injection->open.open == 0u) ? limit_i_q25 : mul_q16(limit_i_q25, FOUR_PHASES_Q16);
}

SMALL_CODE_END
