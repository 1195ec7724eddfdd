// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/fixed.h"
#include "control/placement.h"
#include "control/trig.h"
#include "drive/vector/parts.h"

#define HALF_PI_Q30 1686629713
// Turns below it, 1.4 degrees: the first term of the series is enough.
#define SMALL_TURN_Q32 (1 << 24)
#define CHANGE_MAX_Q32 (1 << 22)

// 1 / count, which seldom changes.
HOT int32_t vector_share_of(share_t *share, uint32_t count) {
  if (count != share->count) {
    share->count = count;
    share->share_q30 = (int32_t)((uint32_t)ONE_Q30 / count);
  }
  return share->share_q30;
}

HOT static int32_t share_v_q25(int32_t sum_v_q17, int32_t share_q30) {
  return (int32_t)(((int64_t)sum_v_q17 * share_q30) >> 22);
}

// Mean of the voltages that acted since the last tick, the first of which came before it, the newest not being among
// them. The observer kept that first one.
HOT static complex_t mean_voltage_v_q25(vector_t *v, const chip_vector_snapshot_t *in) {
  const int32_t share_q30 = vector_share_of(&v->steps, (in->steps > 0u) ? in->steps : 1u);
  const complex_t first_v_q17 = to_q17(v->observer.voltage_v_q25);
  const complex_t sum = complex_sub(complex_add(in->v_sum_q17[0], first_v_q17), in->v_q17[0]);
  return (complex_t){share_v_q25(sum.re, share_q30), share_v_q25(sum.im, share_q30)};
}

static inline complex_t forward_v_q25(const vector_t *v) {
  return (complex_t){v->forward_v_q17.re * 256, v->forward_v_q17.im * 256};
}

// The regulator's state is the voltage without what goes forward. The harmonics that do are those of an EMF that is not to
// be observed.
HOT static complex_t acting_v_q25(const vector_t *v, const chip_vector_snapshot_t *in) {
  const complex_t own = complex_add(in->u_v_q25[0], v->late_v_q25);
  return vector_injects(v) ? complex_add(own, forward_v_q25(v)) : own;
}

HOT static complex_t mean_acting_v_q25(vector_t *v, const chip_vector_snapshot_t *in) {
  const complex_t all = complex_add(mean_voltage_v_q25(v, in), v->late_v_q25);
  return vector_injects(v) ? all : complex_sub(all, forward_v_q25(v));
}

// Turn of the frame in a tick beyond the one that the observer's coefficients were made for, which are up to 6 ms old.
HOT static int32_t drift_rad_q32(const vector_t *v, const vector_design_t *design) {
  const int32_t drift_turn_q36 = v->report.vector.speed_turn_q36 - design->speed_turn_q36;
  return within_i32(drift_turn_q36, v->drift_most_turn_q36) * v->drift_rad_q32;
}

INLINED int32_t vector_observe(vector_t *v, const chip_vector_snapshot_t *in) {
  const vector_design_t *design = &v->design[v->used];
  const emf_observer_gains_t *gains = &design->observer;
  const int32_t drift_q32 = drift_rad_q32(v, design);
  if (v->several) {
    emf_observer_voltage(&v->observer, gains, mean_acting_v_q25(v, in));
    emf_observer_step(&v->observer, gains, in->i_q17[0], drift_q32);
    v->observer.voltage_v_q25 = (complex_t){in->v_q17[0].re * 256, in->v_q17[0].im * 256};
  } else {
    emf_observer_step(&v->observer, gains, in->i_q17[0], drift_q32);
    emf_observer_voltage(&v->observer, gains, acting_v_q25(v, in));
  }
  if (!in->taken) {
    return 0;
  }
  const int32_t turn_q32 = v->correct_q32;
  if (turn_q32 >= -SMALL_TURN_Q32 && turn_q32 <= SMALL_TURN_Q32) {
    emf_observer_turn_small(&v->observer, mul_high_i32(turn_q32 * 16, HALF_PI_Q30));
  } else {
    const complex_t rotation = rotation_q30(turn_q32);
    emf_observer_turn(&v->observer, rotation);
  }
  if (__builtin_expect(v->forwards, 0)) {
    v->forward_v_q17 = v->command.forward.v_q17[0];
  }
  v->correct_q32 = 0;
  v->holding = false;
  return turn_q32;
}

INLINED void vector_emf_error(vector_t *v, bool seen) {
  v->error_q30 = 0;
  if (seen) {
    v->error_q30 = pll_error_from_q30(v->observer.emf_v_q25, v->report.vector.speed_turn_q36,
                                      v->start_settings.minimum_v_q25, &v->emf_reciprocal);
  }
}

INLINED void vector_track(vector_t *v, bool taken) {
  // A correction that has not been taken yet is still in the error.
  if (__builtin_expect(v->sensored, 0) && taken) {
    v->error_q30 = encoder_error_q30(encoder_angle_q32(v), v->frame_turn_q32);
  } else {
    vector_emf_error(v, taken);
  }
  const int32_t correct_q32 = pll_correct(&v->pll, &v->pll_gains, v->error_q30);
  v->correct_q32 = taken ? correct_q32 : v->correct_q32;
  v->report.vector.speed_turn_q36 = pll_speed_turn_q36(&v->pll);
}

INLINED uint32_t vector_emf_amplitude(vector_t *v) {
  v->report.vector.emf_v_q25 = rough_length(v->observer.emf_v_q25);
  return v->report.vector.emf_v_q25;
}

void vector_observe_from(vector_t *v, complex_t current_i_q17, complex_t emf_v_q25) {
  v->forward_v_q17 = v->command.forward.v_q17[0];
  emf_observer_preset(&v->observer, current_i_q17, emf_v_q25, emf_v_q25);
}

void vector_track_from(vector_t *v, int32_t change_q32) {
  pll_preset(&v->pll, 0, v->report.vector.speed_turn_q36);
  if (v->pll_gains.acceleration.mant != 0) {
    const int32_t change_q40 = clamp_i32(change_q32, -CHANGE_MAX_Q32, CHANGE_MAX_Q32) * 256;
    v->pll.acceleration_turn_q60 = (int64_t)(change_q40 / (int32_t)v->per_tick.period_cycles) * (1 << 20);
  }
}

void vector_lead(vector_t *v, int32_t speed_turn_q36) { v->report.vector.speed_turn_q36 = speed_turn_q36; }

void vector_turn(vector_t *v, int32_t turn_q32, bool hold) {
  v->correct_q32 = turn_q32;
  v->holding = hold;
}

// Of a drive with injection; the control step without one has its own copy.
SHARED void vector_observe_injected(vector_t *v, const chip_vector_snapshot_t *in) { (void)vector_observe(v, in); }
