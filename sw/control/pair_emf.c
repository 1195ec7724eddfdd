// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/pair_emf.h"

#include "control/placement.h"

// Before they teach: two ticks whose voltage is known, and the one before.
#define TICKS_MIN 3u
#define THIRD_Q16 21845
#define REST_SHARE 3
#define SWING_SHARE 8
// Of what is off: from 17 bits to 15 of a voltage of 25 - 11.
#define OFF_MAX_Q17 131072
#define OFF_SHIFT 12
#define EMF_SHIFT 11
// A tick tells 3 % of the EMF at most: a step of the load is off by more and belongs to no pair.
#define OFF_MAX_Q15 1024
// 3/32 of it, to 28 bits.
#define LEARN 768
// Of the first two; the third follows.
#define MORE_MAX_Q28 (1 << 26)

SMALL_CODE_BEGIN
// Many places, few bytes.
SHARED static int32_t part_of(int32_t x, int32_t share_q16) { return mul_q16(x, share_q16); }

pair_emf_tick_t pair_emf_tick(int32_t u_v_q25, uint32_t pair, uint32_t other, int32_t other_q16) {
  int32_t share_q24[PAIRS] = {0, 0, 0};
  share_q24[pair] = (1 << 24) - other_q16 * 256;
  share_q24[other] = other_q16 * 256;
  return (pair_emf_tick_t){u_v_q25, {share_q24[0], share_q24[1]}};
}

// What is off goes to those that had the ticks. emf > 0
static void learn(pair_emf_t *e, int32_t v_q25, int32_t emf_v_q25, const int32_t *share_q16, int32_t step_q16) {
  const int32_t last_q16 = 65536 - share_q16[0] - share_q16[1];
  const int32_t known_q28 = part_of(e->more_q28[0], share_q16[0]) + part_of(e->more_q28[1], share_q16[1]) +
                            part_of(e->more_q28[2], last_q16);
  const int32_t off_v_q25 = within_i32(v_q25 - e->rest_v_q25 - part_of(emf_v_q25, known_q28 / 4096), PRODUCT_MAX);
  e->rest_v_q25 += part_of(off_v_q25, step_q16) / REST_SHARE;
  const int32_t off_q15 = (within_i32(off_v_q25 / 256, OFF_MAX_Q17) * (1 << OFF_SHIFT)) / ((emf_v_q25 >> EMF_SHIFT) + 1);
  const int32_t part_q28 = part_of(within_i32(off_q15, OFF_MAX_Q15) * LEARN, step_q16);
  for (uint32_t k = 0; k < PAIRS - 1u; k++) {
    e->more_q28[k] = within_i32(e->more_q28[k] + part_of(part_q28, share_q16[k] - THIRD_Q16), MORE_MAX_Q28);
  }
  e->more_q28[PAIRS - 1u] = -(e->more_q28[0] + e->more_q28[1]);
}

// The tick whose mean current is known now. share: of both ticks.
static void see(pair_emf_t *e, int32_t filter_shift, int32_t *share_q16) {
  const int32_t shift = (e->ticks < TICKS_MIN) ? 0 : filter_shift;
  e->seen.u_v_q25 += (e->told[1].u_v_q25 - e->seen.u_v_q25) >> shift;
  for (uint32_t k = 0; k < PAIRS - 1u; k++) {
    const int32_t before_q24 = e->seen.share_q24[k];
    e->seen.share_q24[k] += (e->told[1].share_q24[k] - before_q24) >> shift;
    share_q16[k] = (e->seen.share_q24[k] + before_q24) >> 9;
  }
}

SHARED void pair_emf_step(pair_emf_t *e, const pair_emf_gains_t *gains, const pair_emf_tick_t *told, int32_t emf_v_q25,
                          int32_t i_q25, int32_t filter_shift, int32_t step_q16) {
  const int32_t before_v_q25 = e->seen.u_v_q25;
  const int32_t rise_i_q25 = i_q25 - e->i_q25;
  const int32_t both_i_q25 = i_q25 - rise_i_q25 / 2;
  int32_t share_q16[PAIRS - 1u];
  see(e, filter_shift, share_q16);
  e->told[1] = e->told[0];
  e->told[0] = *told;
  e->i_q25 = i_q25;
  if (e->ticks < TICKS_MIN) {
    e->ticks++;
    e->mean_i_q25 = i_q25;
    e->rest_v_q25 = 0;
    return;
  }
  const int32_t swing_i_q25 = both_i_q25 - e->mean_i_q25;
  e->mean_i_q25 += part_of(swing_i_q25, step_q16) / SWING_SHARE;
  const int32_t swung_v_q25 = e->swing_v_q25 + gain_apply(swing_i_q25, gains->spring);
  e->swing_v_q25 = within_i32(swung_v_q25 - part_of(e->swing_v_q25, step_q16) / SWING_SHARE, PRODUCT_MAX / 4);
  // Without an EMF nothing of it stands apart: a ramp may run ahead of a rotor that has nearly stopped.
  if (emf_v_q25 > 0) {
    const int32_t u_v_q25 = (e->seen.u_v_q25 + before_v_q25) / 2;
    const int32_t drop_v_q25 = gain_apply(both_i_q25, gains->resistance) + gain_apply(rise_i_q25, gains->inductance);
    learn(e, u_v_q25 - drop_v_q25 - e->swing_v_q25 - emf_v_q25, emf_v_q25, share_q16, step_q16);
  }
}

void pair_emf_pause(pair_emf_t *e) {
  e->ticks = 0;
  e->swing_v_q25 = 0;
}
SMALL_CODE_END
