// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "drive/vector/injected.h"

#include "control/fixed.h"
#include "control/placement.h"
#include "control/regulator_design.h"
#include "control/trig.h"
#include "control/vector_speed.h"
#include "drive/vector/current.h"
#include "drive/vector/parts.h"

// Results until sums hold nothing from before the wave.
#define SETTLING_Q30 107374182  // 0.1 rad
#define SETTLE_SHARE 8u         // 40 ms
#define DARK_SHARE 3u           // 15 ms
#define FREE_SHARE 8            // of the limit
#define BACKWARD_Q32 134217728  // 1/32 turn
#define STALLED_SHARE 2         // of the target
#define STANDS_SHARE 8          // of the target
#define STANDS_LOOKS 20u        // 0.1 s
#define BREAK_AWAY_SHARE 100u   // 0.5 s
#define FIRST_RESULTS 3u
#define WAVE_AFTER 2u  // steps after the one whose set presets the state
#define STOPPED_SHARE_SHIFT 4  // of the lowest speed asked for
// Results of a wave that is there again until they count, over those that are left out where a frame was turned.
#define HANDOVER_RESULTS 3u
// Noise of the angle, 0.3 and 0.6 rad.
#define DERATE_NOISE_Q16 19661u
#define FAULT_NOISE_Q16 39322u
#define ONE_Q16 ((uint32_t)1 << 16)
#define PROVEN_MOST 3u
#define UNEXPLAINED_SHARE 4
#define SPEED_BITS 16      // of the filtered speed below 2^-36 turn
#define NOISE_OVER_RATIO_Q16 29040u  // sqrt(pi) / 4
#define RATIO_MOST_Q24 (64u << 24)
#define LEAST_Q_SHARE 16   // a q amplitude below this share of d's is noise

SMALL_CODE_BEGIN

static injection_method_t method_of(const parameters_t *p) {
  static const injection_method_t methods[] = {INJECTION_LOCK_IN, INJECTION_CONVENTIONAL, INJECTION_IQ,
                                               INJECTION_SEPARATOR};
  return methods[p->injection - 1];
}

static bool hands_over(const parameters_t *p) { return p->injection_fade_q16 > 0; }

COLD static void load_settings(injection_frame_settings_t *s, const vector_t *v) {
  const parameters_t *p = v->p;
  s->error = (injection_error_settings_t){
      .method = method_of(p),
      .ratio = p->injection_ratio,
      .loss = p->injection_loss,
      .shift = INJECTION_SHIFT,
      .minimum_i_q17 = (uint32_t)p->injection_least_i_q21 >> 4,
  };
  s->rest = p->injection_rest;
  // Without a speed of hand-over the EMF never takes over.
  s->handover = (injection_handover_settings_t){INT32_MAX, INT32_MAX - 1, 1, 1};
  if (hands_over(p)) {
    s->handover = (injection_handover_settings_t){p->vector_handover_turn_q36, p->vector_back_turn_q36,
                                                  p->injection_fade_q16,
                                                  HANDOVER_RESULTS * p->injection_rest.settle};
  }
  s->validity = (injection_validity_settings_t){
      .minimum_i_q21 = p->injection_least_i_q21,
      .expected_i_q21 = p->injection_expected_i_q21,
      .saliency_q16 = (uint32_t)p->injection_saliency_q16,
      .derate_ratio_q16 = (uint32_t)p->injection_derate_ratio_q16,
      .fault_ratio_q16 = (uint32_t)p->injection_fault_ratio_q16,
      .noise_factor_q16 = (uint32_t)p->injection_noise_factor_q16,
      .derate_noise_q16 = DERATE_NOISE_Q16,
      .fault_noise_q16 = FAULT_NOISE_Q16,
      .filter_shift = p->injection_filter_shift,
      .fault_results = (uint32_t)p->injection_fault_results,
  };
  s->pll = p->vector_pll;
  s->sequence = (angle_sequence_t)p->injection_sequence;
  s->coupling = p->injection_coupling;
  s->speed = p->vector_speed;
  s->speed_filter_q16 = p->injection_speed_filter_q16;
  s->third_q16 = p->injection_third_q16;
  s->third = SUBSPACES > 1;
  s->tick_cycles = p->tick_cycles;
}

COLD void vector_injection_init(vector_t *v, const vector_machine_t *machine) {
  static vector_injection_t only;
  vector_injection_t *j = &only;
  __builtin_memset(j, 0, sizeof *j);
  v->injection = j;
  load_settings(&j->settings, v);
  j->settings.machine = *machine;
}

COLD outcome_t vector_injection_begin(vector_t *v) {
  vector_injection_t *j = v->injection;
  const outcome_t refused = vector_open_phase_refuses(v);
  if (outcome_event(refused) != EVENT_STAY) {
    return refused;
  }
  // A rotor whose place was known may have moved while the gates were off; a machine without saturation keeps it.
  const bool lost = j->begun && v->p->injection_rest.current_i_q25 > 0;
  injection_frame_begin(&j->frame, &j->settings, v->p->injection_search != 0 || lost, 0);
  j->begun = true;
  const bool filtered = j->settings.error.method == INJECTION_LOCK_IN || j->settings.error.method == INJECTION_CONVENTIONAL;
  // A low-pass that rises would be taken for a weak signal.
  j->left_out = filtered ? j->settings.rest.settle : FIRST_RESULTS;
  j->forward = true;
  j->wanted = true;
  v->design_waits = false;
  j->observing = false;
  j->suspicion = 0;
  j->contradicted = 0;
  j->settling = 0;
  j->proven = 0;
  j->telling = 0;
  j->backward_q32 = 0;
  j->standing = 0;
  j->unproven = j->frame.resting ? 0u : DARK_SHARE * v->lost_checks;
  j->command = (injection_frame_command_t){.inject = true};
  current_wave_anew(&v->command);
  ramp_preset(&j->ramp, 0);
  return refused;
}

COLD void vector_injection_off(vector_t *v) {
  current_wave_off(&v->command);
  v->injection->injecting = false;
  v->injection->wanted = false;
  v->design_waits = false;
}

static fault_t fault_of(injection_verdict_t verdict) {
  switch (verdict) {
    case INJECTION_NO_SIGNAL:
      return FAULT_INJECTION_SIGNAL;
    case INJECTION_NOISE:
      return FAULT_INJECTION_NOISE;
    case INJECTION_NO_SALIENCY:
      return FAULT_NO_SALIENCY;
    case INJECTION_GOOD:
    case INJECTION_DERATED:
    default:
      return FAULT_NONE;
  }
}

// From half the speed on at which the wave is there again.
HOT static void observe_emf(vector_t *v, const chip_vector_snapshot_t *in) {
  vector_injection_t *j = v->injection;
  const bool fast = hands_over(v->p) && abs_sat(v->report.vector.speed_turn_q36) > v->p->vector_back_turn_q36 / 2;
  if (fast && j->observing) {
    vector_observe_injected(v, in);
  } else if (fast) {
    const complex_t emf_v_q25 = {0, gain_apply(v->report.vector.speed_turn_q36, v->p->vector_flux)};
    vector_observe_from(v, in->i_q17[0], emf_v_q25);
    j->observing = true;
  } else {
    j->observing = false;
  }
}

// The EMF belongs to the speed, from half to twice.
HOT static bool emf_there(vector_t *v) {
  const uint32_t amplitude_v_q25 = vector_emf_amplitude(v);
  const uint32_t expected = (uint32_t)abs_sat(gain_apply(v->report.vector.speed_turn_q36, v->p->vector_flux));
  return amplitude_v_q25 >= expected / 2u && amplitude_v_q25 / 2u <= expected;
}

// Held by the EMF alone, and that does not hold.
HOT static bool emf_lost(vector_t *v) {
  vector_injection_t *j = v->injection;
  const bool bad = !emf_there(v) || abs_sat(v->error_q30) > LOST_ERROR_Q30;
  j->suspicion = (bad && !j->frame.handover.inject) ? j->suspicion + 1u : 0u;
  return j->suspicion >= v->lost_checks;
}

static inline uint32_t less(uint32_t count) { return (count > 0u) ? count - 1u : 0u; }

// What a look at the EMF says of the angle.
typedef struct {
  bool dark;     // the EMF is too small to tell the pole
  bool without;  // there is none
  bool turning;  // the loop still turns the frame to the angle that it sees
  bool doubt;    // it does, or the EMF has denied the angle
  int32_t target_turn_q36;  // amount of the wanted speed
  int32_t along_turn_q36;   // speed in its direction
} emf_look_t;

// Where the EMF is too small to tell the pole, the HF current tells it:
//
//   still     the drive holds a rotor that hardly anything turns. A look under way goes on over single noisy ones
//   against   a current drives the way that is wanted, the rotor has gone the other way, further than noise takes one that
//             a load holds: overhauled, or at the other pole
//   unproven  no search has found the angle, and the EMF has had its time; or the EMF has denied the angle before it fell
//             silent. In both the rotor does not turn at half the speed that is asked for. A look goes on until the pole is
//             known or the EMF tells it
COLD static void ask_poles(vector_t *v, emf_look_t look) {
  vector_injection_t *j = v->injection;
  const int32_t wanted_i_q25 = j->frame.wanted_i_q25;
  const int32_t target_rpm_q8 = j->ramp.value_rpm_q8;
  const int32_t speed_turn_q36 = v->report.vector.speed_turn_q36;
  const bool free = abs_sat(wanted_i_q25) < j->settings.limit_i_q25 / FREE_SHARE;
  j->telling = (look.dark || look.without) ? 0u : j->telling + ((j->telling < v->lost_checks) ? 1u : 0u);
  const bool silent = j->telling == 0u || (j->frame.test && j->telling < v->lost_checks);
  const bool still = free && target_rpm_q8 == 0 && silent;
  const bool driving = !free && (target_rpm_q8 == 0 || (wanted_i_q25 ^ target_rpm_q8) >= 0);
  const bool stalled = look.along_turn_q36 < look.target_turn_q36 / STALLED_SHARE;
  const bool against = look.dark && driving && (wanted_i_q25 ^ speed_turn_q36) < 0;
  const int64_t turned_q32 = (int64_t)(abs_sat(speed_turn_q36) >> 4) * j->settings.tick_cycles * (int32_t)VECTOR_GROUPS;
  j->backward_q32 = against ? clamp_i32(sat_i32(j->backward_q32 + turned_q32), 0, BACKWARD_Q32) : 0;
  if (!look.dark && !(j->frame.test && look.doubt)) {
    j->frame.rest.pole = (j->frame.rest.pole < 0) ? j->frame.rest.pole : 0;
    if (j->proven >= v->lost_checks) {
      j->unproven = (j->contradicted > 0u) ? 1u : look.turning ? j->unproven : 0u;
    }
  } else if (j->frame.rest.pole > 0) {
    j->unproven = 0;
  } else if (j->unproven > 1u && !look.turning) {
    j->unproven--;
  }
  const bool unproven = j->unproven == 1u && (j->frame.test || (look.dark && stalled && !look.turning));
  const bool asked = still || j->backward_q32 == BACKWARD_Q32 || unproven;
  j->frame.test = v->p->injection_rest.current_i_q25 > 0 && asked;
}

// A rotor that has stood for 0.1 s: friction holds it. A loop that noise makes slow would take seconds to the current that it
// needs; half a second to the limit is enough.
COLD static void break_away(vector_t *v, emf_look_t look) {
  vector_injection_t *j = v->injection;
  const bool slow = abs_sat(look.along_turn_q36) < look.target_turn_q36 / STANDS_SHARE;
  if (!look.dark || !slow || look.turning || j->frame.test) {
    j->standing = less(j->standing);
  } else if (j->standing < STANDS_LOOKS * v->lost_checks) {
    j->standing++;
  } else if (!j->frame.limited) {
    const int32_t step_i_q25 = j->settings.limit_i_q25 / (int32_t)(BREAK_AWAY_SHARE * v->lost_checks);
    pi_shift(&j->frame.speed, (j->ramp.value_rpm_q8 < 0) ? -step_i_q25 : step_i_q25);
  }
}

// With E the EMF of the estimated speed: what voltage and resistance leave of it, which is -E at the other pole and
// nothing on a rotor that stands, is below E / 2 by more than T, which both may be wrong by (lost_angle.h). Not below T.
// An angle that the EMF has confirmed keeps its trust for a while: a load step makes the speed wrong, and not the pole. While
// the loop still turns the frame to the angle that it sees, its speed is that turning, unless there is an EMF against it:
// for a while too where no search has found the angle. Where it tells nothing, the poles are looked at: of a rotor whose
// place no search has found, that is held without a load, or that turns against its torque.
HOT static bool emf_contradicts(vector_t *v, int32_t q_i_q17) {
  vector_injection_t *j = v->injection;
  const int32_t speed_turn_q36 = (int32_t)(j->frame.filtered_q52 >> SPEED_BITS);
  const int32_t expected_v_q25 = gain_apply(speed_turn_q36, v->p->vector_flux);
  const int32_t half_drop_v_q25 = gain_apply(q_i_q17 * 256, v->lost.resistance);
  const int32_t emf_v_q25 = v->state_v_q25.im - 2 * half_drop_v_q25;
  const int32_t along_v_q25 = (expected_v_q25 < 0) ? -emf_v_q25 : emf_v_q25;
  const int32_t wrong_v_q25 = abs_sat(half_drop_v_q25) + (int32_t)v->lost.floor_v_q25;
  const int32_t size_v_q25 = abs_sat(expected_v_q25);
  const bool settles = abs_sat(j->frame.error_q30) > SETTLING_Q30;
  const bool unsearched = settles && v->p->injection_search == 0;
  j->settling = unsearched ? SETTLE_SHARE * v->lost_checks : less(j->settling);
  const bool dark = size_v_q25 <= wrong_v_q25;
  const bool turning = settles || j->settling > 0u;
  const bool opposed = along_v_q25 < -wrong_v_q25;
  const bool blind = dark || (turning && !opposed);
  // A voltage that no speed explains: an open phase lets no current come, or the rotor turns and the frame does not.
  const bool unexplained = dark && abs_sat(along_v_q25) / UNEXPLAINED_SHARE > wrong_v_q25;
  const bool wrong = unexplained || (!blind && along_v_q25 + wrong_v_q25 < size_v_q25 / 2);
  j->contradicted = wrong ? j->contradicted + 1u : less(j->contradicted);
  if (blind) {
    j->proven = less(j->proven);
  } else if (!wrong && j->proven < PROVEN_MOST * v->lost_checks) {
    j->proven++;
  }
  const int32_t speed_now_turn_q36 = v->report.vector.speed_turn_q36;
  const emf_look_t look = {
      .dark = dark,
      .without = abs_sat(along_v_q25) <= wrong_v_q25,
      .turning = turning,
      .doubt = settles || j->contradicted > 0u,
      .target_turn_q36 = abs_sat(gain_apply(j->ramp.value_rpm_q8, v->p->vector_rpm_to_turn)),
      .along_turn_q36 = (j->ramp.value_rpm_q8 < 0) ? -speed_now_turn_q36 : speed_now_turn_q36,
  };
  ask_poles(v, look);
  break_away(v, look);
  return j->frame.rest.pole < 0 || j->contradicted >= v->lost_checks + j->proven;
}

// The search has measured both axes: that counts, not the file. With D and D - 2 K the amplitudes of d and q
// L_q / (L_q - L_d) = D / 2 K.
COLD static void learn_saliency(vector_injection_t *j) {
  const rest_position_t *rest = &j->frame.rest;
  injection_validity_settings_t *s = &j->settings.validity;
  const int32_t q_i_q21 = rest->d_i_q21 - 2 * rest->saliency_i_q21;
  if (q_i_q21 <= rest->d_i_q21 / LEAST_Q_SHARE) {
    return;
  }
  const uint32_t over_q16 = div_sat_u32((uint64_t)(uint32_t)rest->saliency_i_q21 << 17, (uint32_t)q_i_q21);
  s->expected_i_q21 = rest->d_i_q21;
  s->saliency_q16 = ONE_Q16 + over_q16;
  s->derate_ratio_q16 = ONE_Q16 + over_q16 * 2u / 5u;
  s->fault_ratio_q16 = ONE_Q16 + over_q16 / 10u;
  const uint32_t ratio_q24 = div_sat_u32((uint64_t)(uint32_t)rest->d_i_q21 << 23, (uint32_t)rest->saliency_i_q21);
  const uint32_t held_q24 = (ratio_q24 < RATIO_MOST_Q24) ? ratio_q24 : RATIO_MOST_Q24;
  j->settings.error.ratio = (gain_t){(int32_t)held_q24, 24};
  s->noise_factor_q16 = (uint32_t)(((uint64_t)held_q24 * NOISE_OVER_RATIO_Q16) >> 24);
}

// The search has ended, or the angle is not to be trusted any more.
HOT static outcome_t supervise(vector_t *v) {
  const injection_frame_t *frame = &v->injection->frame;
  fault_t fault = fault_of(frame->validity.verdict);
  if (frame->resting && frame->rest.phase == REST_NOT_SURE) {
    fault = FAULT_POLARITY_UNSURE;
  } else if (frame->resting && frame->rest.phase == REST_NO_SIGNAL) {
    fault = FAULT_INJECTION_SIGNAL;
  }
  if (fault != FAULT_NONE) {
    return outcome_fault(fault);
  }
  if (emf_lost(v)) {
    return outcome_because(EVENT_LOCK_LOST, FAULT_ANGLE_LOST);
  }
  const bool started = !frame->resting && v->order->state == STATE_STARTING;
  return outcome_of(started ? EVENT_STARTED : EVENT_STAY);
}

// The target's sign is taken through zero, zero is a target.
HOT static outcome_t follow_target(vector_t *v) {
  vector_injection_t *j = v->injection;
  const parameters_t *p = v->p;
  const bool stopping = v->order->state == STATE_STOPPING;
  const int32_t step_rpm_q20 = clamp_i32(v->settings->accel_rpm_q20, 1, INT32_MAX / (int32_t)VECTOR_GROUPS);
  const int32_t target_rpm_q8 = (v->order->state == STATE_RUNNING) ? v->settings->target_rpm * 256 : 0;
  tell_speed(v, rpm_q8(v, v->report.vector.speed_turn_q36), !j->frame.resting);
  // The ramp need not wait for the speed: the regulator does not wind up.
  (void)ramp_step(&j->ramp, target_rpm_q8, step_rpm_q20 * (int32_t)VECTOR_GROUPS, v->report.speed_rpm_q8,
                  p->speed_max_rpm * 256);
  const int32_t speed_rpm_q8 = abs_sat(v->report.speed_rpm_q8);
  // An estimate in doubt gets the name of what is wrong with it, 5 ms later at most.
  if (speed_rpm_q8 / 256 > p->overspeed_rpm && j->contradicted == 0u && j->suspicion == 0u &&
      j->frame.validity.bad == 0u) {
    return outcome_fault(FAULT_OVERSPEED);
  }
  const bool stopped =
      stopping && j->ramp.value_rpm_q8 == 0 && speed_rpm_q8 < v->back_rpm_q8 >> STOPPED_SHARE_SHIFT;
  return outcome_of(stopped ? EVENT_STOPPED : EVENT_STAY);
}

// Mean of the last states: with the separator the state swings with the wave.
HOT static complex_t mean_state_v_q25(vector_injection_t *j, uint32_t tick, complex_t state_v_q25) {
  complex_t *oldest = &j->state_v_q25[tick % WAVE_SAMPLES];
  const complex_t now = {state_v_q25.re / (int32_t)WAVE_SAMPLES, state_v_q25.im / (int32_t)WAVE_SAMPLES};
  j->mean_v_q25.re += now.re - oldest->re;
  j->mean_v_q25.im += now.im - oldest->im;
  *oldest = now;
  return j->mean_v_q25;
}

// With the separator the regulators' gains change with the wave: a design for what the frame wants now waits for the wave's
// change, and the change for it. True: they can change together, or the gains stay.
HOT static bool gains_ready(vector_t *v) {
  vector_injection_t *j = v->injection;
  v->design_waits = j->wanted != j->forward && j->settings.error.method == INJECTION_SEPARATOR;
  if (!v->design_waits) {
    return true;
  }
  return vector_design_meant(v);
}

// The frame's turn, and the EMF as forward voltage while there is a wave. Before the wave comes and where it goes the
// regulator takes what changes into its state, held for a tick. The set acts two steps from here.
HOT static void send_forward(vector_t *v, const chip_injection_snapshot_t *seen, complex_t state_v_q25) {
  vector_injection_t *j = v->injection;
  const complex_t mean_v_q25 = mean_state_v_q25(j, vector_turn_tick(v, v->order), state_v_q25);
  const complex_t before_v_q25 = j->forward_v_q25;
  const complex_t none = {0, 0};
  const complex_t emf_v_q25 = {0, gain_apply(v->report.vector.speed_turn_q36, v->p->vector_flux)};
  // With the separator and a wave only the steps with an odd phase take a preset state.
  const bool takes =
      j->settings.error.method != INJECTION_SEPARATOR || !seen->active || seen->phase % 2u != 0u;
  j->wanted = j->command.inject;
  const bool hold = gains_ready(v) && j->wanted != j->forward && takes;
  vector_turn(v, j->command.turn_q32, hold);
  j->forward = hold ? j->wanted : j->forward;
  j->forward_v_q25 = j->forward ? complex_mul_q30(emf_v_q25, j->frame.turn_q30) : none;
  if (hold) {
    current_preset(&v->command, 0, complex_add(mean_v_q25, complex_sub(before_v_q25, j->forward_v_q25)));
    j->taken_in = WAVE_AFTER;
    if (v->design_waits) {
      vector_take_design(v);
      v->design_waits = false;
    }
  } else if (j->taken_in > 0u) {
    j->taken_in--;
  }
  j->command.inject = j->forward && (j->injecting || j->taken_in == 0u);
}

HOT static outcome_t look(vector_t *v, const chip_snapshot_t *in) {
  const outcome_t outcome = vector_open_phase_step(v, in);
  return (outcome_event(outcome) == EVENT_STAY) ? outcome | supervise(v) : outcome;
}

// In another turn: the tick of both would be the longest.
HOT static outcome_t look_at_emf(vector_t *v, const chip_vector_snapshot_t *in) {
  vector_design_state(v, complex_add(in->u_v_q25[0], v->injection->forward_v_q25));
  const bool wrong = !v->injection->frame.resting && emf_contradicts(v, in->i_q17[0].im);
  return wrong ? outcome_because(EVENT_LOCK_LOST, FAULT_ANGLE_LOST) : outcome_of(EVENT_STAY);
}

SHARED outcome_t vector_injection_step(vector_t *v, const chip_snapshot_t *in) {
  vector_injection_t *j = v->injection;
  const chip_injection_snapshot_t *seen = &in->injection;
  observe_emf(v, &in->vector);
  // A set that has not been taken keeps its turn.
  if (!in->vector.taken) {
    return outcome_of(EVENT_STAY);
  }
  bool fresh = seen->active && seen->results != j->results;
  j->results = seen->results;
  if (fresh && j->left_out > 0u) {
    j->left_out--;
    fresh = false;
  }
  if (j->settings.error.method == INJECTION_SEPARATOR) {
    const bool before = j->arrived;
    j->arrived = fresh;
    fresh = before;
  }
  vector_emf_error(v, j->observing);
  const complex_t i_q17 = in->vector.i_q17[0];
  const injection_frame_input_t given = {
      .fresh = fresh,
      .amplitude = {seen->d, seen->q, seen->count},
      .current_i_q25 = {i_q17.re * 256, i_q17.im * 256},
      .emf_error_q30 = v->error_q30,
      .emf_there = j->observing && emf_there(v),
      .by_speed = true,
      .speed_turn_q36 = gain_apply(j->ramp.value_rpm_q8, v->p->vector_rpm_to_turn),
  };
  j->settings.limit_i_q25 = vector_open_phase_limit_i_q25(v);
  const bool resting = j->frame.resting;
  if (__builtin_expect(resting, 0)) {
    vector_open_phase_listen(v, in);
  }
  injection_frame_step(&j->frame, &j->settings, &given, &j->command);
  if (__builtin_expect(resting && !j->frame.resting, 0)) {
    learn_saliency(j);
  }
  vector_lead(v, j->command.speed_turn_q36);
  send_forward(v, seen, in->vector.u_v_q25[0]);
  switch (vector_turn_tick(v, v->order) % VECTOR_GROUPS) {
    case GROUP_SPEED:
      return follow_target(v);
    case GROUP_FIELD:
      return look_at_emf(v, &in->vector);
    case GROUP_SUPERVISION:
      return look(v, in);
    case GROUP_LIMITS:
    default:
      return outcome_of(EVENT_STAY);
  }
}

HOT void vector_injection_report(vector_t *v) {
  const vector_injection_t *j = v->injection;
  const injection_validity_t *validity = &j->frame.validity;
  vector_report_t *r = &v->report.vector;
  r->published_q32 = (uint32_t)j->command.report_q32 + (uint32_t)j->command.curve_q32;
  r->open_phases = j->open.open;
  r->injection_q16[0] = validity->share_q16;
  r->injection_q16[1] = validity->noise_q16;
  r->injection_q16[2] = validity->ratio_q16;
  r->injection_q16[3] = (uint32_t)j->frame.handover.share_q16;
}

SHARED uint32_t vector_injection_circle(const vector_t *v, uint32_t circle_v_q17) {
  return v->injection->injecting ? (uint32_t)current_rest_i_q25((int32_t)circle_v_q17, v->p->injection_v_q17)
                                 : circle_v_q17;
}

SHARED void vector_injection_command(vector_t *v) {
  vector_injection_t *j = v->injection;
  vector_command_t *c = &v->command;
  const bool inject = j->command.inject;
  current_forward(c, 0, to_q17(j->forward_v_q25));
  if (SUBSPACES > 1) {
    const complex_t emf_v_q25 = {0, gain_apply(v->report.vector.speed_turn_q36, v->p->injection_third_flux)};
    current_forward(c, 1, to_q17(complex_mul_q30(emf_v_q25, j->frame.third_turn_q30)));
    current_second(c, to_q17(j->command.reference_i_q25[1]), j->open.open == 0u);
  }
  current_wave(c, inject, inject != j->injecting);
  // At the start the filters' time to settle is more.
  if (inject && !j->injecting && j->left_out < FIRST_RESULTS) {
    j->left_out = FIRST_RESULTS;
  }
  j->injecting = inject;
}

SMALL_CODE_END
