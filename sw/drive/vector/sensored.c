// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// The encoder of a drive whose frame follows it: where the rotor is, and whether the machine agrees.

#include "control/fixed.h"
#include "control/placement.h"
#include "drive/vector/parts.h"

// Time at the largest current without an EMF, of a rotor whose encoder is in doubt, over that of an angle that is astray.
#define STILL_SHARE 10u
// An index that strays by more than 6 degrees, so many times with less than two turns between them. At the first look the loop
// has left 5 degrees of them.
#define STRAY_ERROR_Q30 93622000
#define STRAYS_MAX 3u
#define STRAY_TURNS 2u
#define STRAY_TICKS_MAX (1u << 24)
// Of the proof: 20 degrees beyond the swing of the alignment, or half a turn of the frame without it.
#define BEYOND_Q32 238609294
#define LED_MOST_Q32 (15 << 27)
// Of the proof while coasting.
#define COAST_Q32 (1 << 30)
// The EMF's word against the encoder is four times as heavy as one for it.
#define ASTRAY_WEIGHT 4u
// A rotor that swings about the place that holds it is fast for a third of the time.
#define HELD_WEIGHT 2u

// Further than 45 degrees.
static bool is_far(int32_t turn_q32) { return turn_q32 > 1 << 29 || turn_q32 < -(1 << 29); }

// An index that turns the angle by more than 45 degrees away from that of the alignment is wrong, or a load has held the rotor
// off: the EMF will tell, or a rotor that does not get faster at the largest current.
static void doubt_index(vector_t *v, uint32_t learnt_q32) {
  v->index_jumped = is_far((int32_t)((uint32_t)v->p->encoder_offset_q32 - learnt_q32));
}

COLD static void see_index(vector_t *v) {
  v->indexed = true;
  if (v->learnt) {
    doubt_index(v, v->encoder_offset_q32);
  }
  v->encoder_offset_q32 = (uint32_t)v->p->encoder_offset_q32;
}

HOT void vector_read_encoder(vector_t *v, const chip_vector_snapshot_t *in) {
  v->encoder_turn_q32 = encoder_turn_q32(&v->encoder_settings, in->encoder_position, v->report.vector.speed_turn_q36);
  if (__builtin_expect(in->encoder_indexed && !v->indexed, 0)) {
    see_index(v);
  }
}

SMALL_CODE_BEGIN

// The rotor swings about the standing current.
COLD void vector_watch_alignment(vector_t *v) {
  if (v->start.aligned_ticks <= 1u) {
    encoder_swing_begin(&v->swing, v->encoder_turn_q32);
  }
  encoder_swing_step(&v->swing, v->encoder_turn_q32);
}

COLD void vector_learn_mounting(vector_t *v, const chip_vector_snapshot_t *in) {
  const uint32_t learnt_q32 = v->frame_turn_q32 - encoder_swing_middle_q32(&v->swing);
  v->proof_turn_q32 = v->frame_turn_q32;
  v->learnt = true;
  if (in->encoder_indexed) {
    doubt_index(v, learnt_q32);
  } else {
    v->encoder_offset_q32 = learnt_q32;
  }
}

COLD encoder_proof_t vector_prove_encoder(const vector_t *v) {
  const int32_t led_q32 = (int32_t)(v->frame_turn_q32 - v->proof_turn_q32);
  const int64_t moved_q32 = (int32_t)(v->encoder_turn_q32 - v->swing.first_turn_q32);
  const bool above = moved_q32 - BEYOND_Q32 > v->swing.highest_turn_q32;
  const bool below = moved_q32 + BEYOND_Q32 < v->swing.lowest_turn_q32;
  if (v->encoder_right || ((led_q32 < 0) ? below : above) || abs_sat(led_q32) > LED_MOST_Q32) {
    return ENCODER_RIGHT;
  }
  return (above || below) ? ENCODER_WRONG : ENCODER_UNPROVEN;
}

COLD encoder_proof_t vector_prove_coasting(vector_t *v, uint32_t rotor_turn_q32, bool indexed) {
  if (!v->proving) {
    v->proving = true;
    v->proof_turn_q32 = rotor_turn_q32;
    if (!indexed) {
      v->encoder_offset_q32 = rotor_turn_q32 - v->encoder_turn_q32;
    }
  }
  if (is_far((int32_t)(encoder_angle_q32(v) - rotor_turn_q32))) {
    return ENCODER_WRONG;
  }
  return (abs_sat((int32_t)(rotor_turn_q32 - v->proof_turn_q32)) < COAST_Q32) ? ENCODER_UNPROVEN : ENCODER_RIGHT;
}

SMALL_CODE_END

HOT void vector_compare_encoder(vector_t *v, const chip_vector_snapshot_t *in) {
  v->report.vector.encoder_ahead_q30 = v->encoder ? encoder_error_q30(encoder_angle_q32(v), v->frame_turn_q32) : 0;
  v->report.vector.encoder_faults += (uint16_t)(in->encoder_invalid - v->encoder_invalid);
  v->encoder_invalid = in->encoder_invalid;
}

SMALL_CODE_BEGIN

// A rotor that turns while its encoder stands still, or whose encoder leaps.
COLD static bool contradicted(vector_t *v, uint32_t expected_v_q25) {
  const bool bad = abs_sat(v->error_q30) > LOST_ERROR_Q30 ||
                   v->report.vector.emf_v_q25 / 2u > expected_v_q25 + v->start_settings.minimum_v_q25;
  v->contradictions = bad ? v->contradictions + 1u : 0u;
  return v->contradictions >= v->lost_checks;
}

// An index that comes at another position, turn after turn: wrong counts of a turn, or lost ones.
COLD static bool index_strays(vector_t *v, uint16_t strayed) {
  // The counter may be ahead of the position: two looks.
  const int32_t jump_q30 = abs_sat(encoder_error_q30(encoder_angle_q32(v), v->frame_turn_q32));
  if (strayed != v->encoder_strayed) {
    v->encoder_strayed = strayed;
    v->stray_q30 = jump_q30;
    v->stray_waits = true;
    return false;
  }
  v->stray_waits = false;
  const uint32_t ticks = clamp_u32(v->order->tick - v->stray_tick, 0, STRAY_TICKS_MAX);
  const uint64_t tick_q36 = (uint64_t)(uint32_t)abs_sat(v->calm_turn_q36) * (uint32_t)v->p->tick_cycles;
  const bool soon = tick_q36 * ticks < (uint64_t)(STRAY_TURNS * (uint32_t)v->p->pole_pairs) << 36;
  v->stray_tick = v->order->tick;
  if (jump_q30 < STRAY_ERROR_Q30 && v->stray_q30 < STRAY_ERROR_Q30) {
    v->strays = 0;
    return false;
  }
  v->strays = soon ? v->strays + 1u : 1u;
  return v->strays >= STRAYS_MAX;
}

// Two thirds of the largest current leave the rotor at less than half of the ramp's speed, and it does not get faster. Of one
// that an EMF has agreed with only a standstill at the largest current counts.
static bool is_held(vector_t *v) {
  const int32_t i_q25 = v->reference_i_q25.im;
  const int32_t speed_rpm_q8 = (i_q25 < 0) ? -v->report.speed_rpm_q8 : v->report.speed_rpm_q8;
  const int32_t wanted_rpm_q8 = abs_sat(v->ramp.value_rpm_q8);
  if (v->encoder_right) {
    return v->report.limit == LIMIT_CURRENT && abs_sat(speed_rpm_q8) < wanted_rpm_q8 / 16;
  }
  if (v->still == 0u) {
    v->fastest_rpm_q8 = speed_rpm_q8;
  }
  return abs_sat(i_q25) / 256 > v->settings->current_limit_q17 / 3 * 2 && speed_rpm_q8 < wanted_rpm_q8 / 2 &&
         speed_rpm_q8 - v->fastest_rpm_q8 < v->back_rpm_q8 / 16;
}

// A load or a brake holds the rotor, or the encoder is wrong. A drive whose encoder an EMF has agreed with goes on, and the
// log says so.
COLD static outcome_t judge_stall(const vector_t *v) {
  if (v->encoder_right) {
    return outcome_passing(outcome_of(EVENT_STAY), FAULT_STALLED);
  }
  return v->index_jumped ? outcome_fault(FAULT_ENCODER) : outcome_because(EVENT_LOCK_LOST, FAULT_STALLED);
}

// Voltage that the observer may be wrong by (lost_angle.h).
static uint32_t wrong_v_q25(const vector_t *v) {
  const int32_t length_i_q25 = (int32_t)(rough_length(v->report.vector.current_i_q17) << 8);
  return (uint32_t)gain_apply(length_i_q25, v->lost.resistance) + v->lost.floor_v_q25;
}

// An encoder whose angle is not that of the EMF, by more than 45 degrees, or whose speed is over twice that of the EMF. Each
// where there is an EMF to see, by its size and by the encoder's speed, or to miss: of a rotor that stands the observer
// shows what the dead time leaves.
COLD static outcome_t judge_angle(vector_t *v, uint32_t expected_v_q25) {
  const complex_t emf_v_q25 = v->observer.emf_v_q25;
  const uint32_t half_v_q25 = v->report.vector.emf_v_q25 / 2u;
  const uint32_t least_v_q25 = wrong_v_q25(v);
  const int32_t ahead_v_q25 = (v->direction > 0) ? emf_v_q25.im : -emf_v_q25.im;
  const bool missing = expected_v_q25 / 2u > least_v_q25 && half_v_q25 < expected_v_q25 / 4u;
  const bool seen = (half_v_q25 > least_v_q25 && expected_v_q25 > least_v_q25) || missing;
  const bool off = missing || (seen && ahead_v_q25 < abs_sat(emf_v_q25.re));
  if (off) {
    v->astray += ASTRAY_WEIGHT;
  } else if (seen && v->astray > 0u) {
    v->astray--;
  }
  v->encoder_right = v->encoder_right || (seen && v->astray == 0u);
  const uint32_t before = v->still;
  const uint32_t most = HELD_WEIGHT * STILL_SHARE * v->lost_checks;
  if (is_held(v)) {
    v->still += (before < 2u * most) ? HELD_WEIGHT : 0u;
  } else if (before > 0u) {
    v->still--;
  }
  if (v->astray >= ASTRAY_WEIGHT * v->lost_checks) {
    return outcome_fault(FAULT_ENCODER);
  }
  return (before < most && v->still >= most) ? judge_stall(v) : outcome_of(EVENT_STAY);
}

COLD outcome_t vector_judge_encoder(vector_t *v, uint32_t expected_v_q25, const chip_vector_snapshot_t *in) {
  const bool lost = contradicted(v, expected_v_q25);
  const bool stray = in->encoder_strayed != v->encoder_strayed || v->stray_waits;
  if (__builtin_expect(stray, 0)) {
    if (index_strays(v, in->encoder_strayed)) {
      return outcome_fault(FAULT_ENCODER);
    }
  } else {
    v->calm_turn_q36 = v->report.vector.speed_turn_q36;
  }
  const outcome_t outcome = judge_angle(v, expected_v_q25);
  return (lost && outcome == 0u) ? outcome_because(EVENT_LOCK_LOST, FAULT_ENCODER) : outcome;
}

COLD void vector_doubt_encoder(vector_t *v) {
  v->proving = false;
  v->contradictions = 0;
  v->astray = 0;
  v->still = 0;
  v->strays = 0;
  v->stray_waits = false;
}
SMALL_CODE_END
