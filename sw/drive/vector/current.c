// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "drive/vector/current.h"

#include "control/placement.h"

#define SCALE_BITS 17u
#define SCALE_SHIFT_MAX 31

static const complex_t zero = {0, 0};

void current_on(vector_command_t *c) {
  c->control.enable = true;
  c->fresh |= FRESH_CONTROL;
}

void current_off(vector_command_t *c) {
  c->control.enable = false;
  c->control.regulate[0] = false;
  c->control.preset_v_q17[0] = zero;
  c->fresh |= FRESH_CONTROL;
}

void current_preset(vector_command_t *c, uint32_t subspace, complex_t voltage_v_q25) {
  c->control.preset_v_q17[subspace] = voltage_v_q17(voltage_v_q25);
  c->fresh |= FRESH_CONTROL;
}

void current_gains(vector_command_t *c, uint32_t subspace, const regulator_gains_t *gains) {
  c->gains.gain[subspace] = gains->g;
  c->gains.hold[subspace] = gains->h;
  c->gains.ratio_q17[subspace] = gains->ratio_q17;
  c->gains.shift[subspace] = (uint32_t)gains->shift;
}

void current_band(vector_command_t *c, uint32_t band_i_q17) {
  c->gains.band_i_q17 = band_i_q17;
  c->fresh |= FRESH_GAINS;
}

INLINED void current_limits(vector_command_t *c, uint32_t first_v_q17, uint32_t second_v_q17, int32_t lead_q32,
                            gain_t scale_v, int32_t vdc_v_q25) {
  // To 15 bits or more; the measured voltage has 17. Rounded down: a voltage is never too large by it.
  const uint32_t vdc_q17 = (vdc_v_q25 > 256) ? (uint32_t)vdc_v_q25 >> 8 : 1u;
  uint32_t scale = ((uint32_t)scale_v.mant << 1) / vdc_q17;
  int32_t shift = scale_v.shift + 9;
  while (scale >> SCALE_BITS != 0u || shift > SCALE_SHIFT_MAX) {
    scale >>= 1;
    shift--;
  }
  limits_command_t *limits = &c->limits;
  limits->v_q17[0] = first_v_q17;
  if (SUBSPACES > 1) {
    limits->v_q17[1] = second_v_q17;
  }
  limits->lead_q32 = lead_q32;
  limits->scale = scale;
  limits->scale_shift = (uint32_t)((shift > 1) ? shift : 1);
  c->fresh |= FRESH_LIMITS;
}

INLINED void current_frame(vector_command_t *c, int32_t speed_turn_q36, int32_t turn_q32, complex_t reference_i_q17,
                           bool regulate, bool repeat) {
  c->omega_turn_q36 = speed_turn_q36;
  c->correct_q32 = turn_q32;
  if (reference_i_q17.re != c->reference.i_q17[0].re || reference_i_q17.im != c->reference.i_q17[0].im) {
    c->reference.i_q17[0] = reference_i_q17;
    c->fresh |= FRESH_REFERENCE;
  }
  if (repeat || regulate != c->control.regulate[0]) {
    c->control.regulate[0] = regulate;
    c->fresh |= FRESH_CONTROL;
  }
}

HOT void current_second(vector_command_t *c, complex_t reference_i_q17, bool regulate) {
  c->reference.i_q17[1] = reference_i_q17;
  c->fresh |= FRESH_REFERENCE;
  if (c->control.regulate[1] != regulate) {
    c->control.regulate[1] = regulate;
    c->fresh |= FRESH_CONTROL;
  }
}

HOT void current_forward(vector_command_t *c, uint32_t subspace, complex_t voltage_v_q17) {
  c->forward.v_q17[subspace] = voltage_v_q17;
  c->fresh |= FRESH_FORWARD;
}

HOT void current_wave(vector_command_t *c, bool inject, bool send) {
  c->injection.inject = inject;
  c->fresh |= send ? FRESH_INJECTION : 0u;
}

void current_wave_anew(vector_command_t *c) { c->injection.clear = true; }

COLD void current_wave_off(vector_command_t *c) {
  current_wave(c, false, true);
  for (uint32_t s = 0; s < SUBSPACES; s++) {
    c->control.regulate[s] = false;
    c->control.preset_v_q17[s] = zero;
    c->reference.i_q17[s] = zero;
    current_forward(c, s, zero);
  }
  c->fresh |= FRESH_CONTROL | FRESH_REFERENCE;
}

void current_look_at_angle(vector_command_t *c, bool angle) { c->look.angle = angle; }

INLINED void current_look(vector_command_t *c, bool slow, bool currents, bool steps) {
  c->look.slow = slow;
  if (slow) {
    c->look.currents = currents;
  }
  c->look.steps = steps;
}

void current_tick(vector_command_t *c, bool by_samples) {
  c->tick.by_samples = by_samples;
  c->fresh |= FRESH_TICK;
}
