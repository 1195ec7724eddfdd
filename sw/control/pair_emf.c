// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/pair_emf.h"

#include "control/placement.h"

// After a commutation the filter shows the pair before it; fewer ticks tell too little.
#define TICKS_LEFT_OUT 2u
#define TICKS_MIN 4u
// What stands apart over what each other pair loses of it: 32; from 17 bits to 20 over a voltage of 25 - 11.
#define LEARN_SHIFT 12
#define EMF_SHIFT 11
#define APART_MAX_Q17 131072

// To a pair, half of it from each other one: their mean stays 0.
static void share_out(pair_emf_t *e, uint32_t pair, int32_t half_q20) {
  for (uint32_t k = 0; k < PAIRS; k++) {
    e->more_q20[k] += (k == pair) ? 2 * half_q20 : -half_q20;
  }
}

// The sector that ended.
COLD static void close_sector(pair_emf_t *e, const pair_emf_gains_t *gains, int32_t emf_v_q25) {
  // Without an EMF nothing of it stands apart: a ramp may run ahead of a rotor that has nearly stopped.
  if (e->ticks < TICKS_MIN || emf_v_q25 <= 0) {
    e->sectors = 0;
    return;
  }
  const int32_t ticks = (int32_t)(e->ticks - TICKS_LEFT_OUT);
  const int32_t rise_v_q17 = gain_apply(e->last_i_q25 - e->first_i_q25, gains->inductance) / 256;
  const int32_t v_q17 = (e->sum_v_q17 - rise_v_q17) / ticks;
  const int32_t i_q17 = e->sum_i_q17 / ticks;
  if (e->sectors < 2u) {
    e->sectors++;
    e->mean_i_q25 = i_q17 * 256;
  } else {
    const int32_t apart_v_q17 = within_i32(e->sector_v_q17[0] - (e->sector_v_q17[1] + v_q17) / 2, APART_MAX_Q17);
    const int32_t apart_q20 = (apart_v_q17 * (1 << LEARN_SHIFT)) / ((emf_v_q25 >> EMF_SHIFT) + 1);
    share_out(e, (e->commutations + PAIRS - 1u) % PAIRS, apart_q20);
    e->mean_i_q25 = (e->sector_i_q17[0] + e->sector_i_q17[1] + i_q17) / 3 * 256;
  }
  e->sector_v_q17[1] = e->sector_v_q17[0];
  e->sector_i_q17[1] = e->sector_i_q17[0];
  e->sector_v_q17[0] = v_q17;
  e->sector_i_q17[0] = i_q17;
  e->swing_v_q25 -= e->swing_v_q25 / 8;
}

HOT void pair_emf_step(pair_emf_t *e, const pair_emf_gains_t *gains, int32_t u_v_q25, int32_t emf_v_q25, int32_t i_q25,
                       int32_t filter_shift, uint32_t commutations) {
  e->seen_v_q25 += (e->u_v_q25[1] - e->seen_v_q25) >> filter_shift;
  e->u_v_q25[1] = e->u_v_q25[0];
  e->u_v_q25[0] = u_v_q25;
  e->swing_v_q25 = within_i32(e->swing_v_q25 + gain_apply(i_q25 - e->mean_i_q25, gains->spring), PRODUCT_MAX / 4);
  if (commutations != e->commutations) {
    close_sector(e, gains, emf_v_q25);
    e->commutations = commutations;
    e->ticks = 0;
    e->sum_v_q17 = 0;
    e->sum_i_q17 = 0;
    return;
  }
  e->ticks++;
  if (e->ticks <= TICKS_LEFT_OUT) {
    e->first_i_q25 = i_q25;
    return;
  }
  e->last_i_q25 = i_q25;
  e->sum_v_q17 += (e->seen_v_q25 - gain_apply(i_q25, gains->resistance) - e->swing_v_q25) / 256;
  e->sum_i_q17 += i_q25 / 256;
}

HOT void pair_emf_pause(pair_emf_t *e) {
  e->sectors = 0;
  e->ticks = 0;
  e->sum_v_q17 = 0;
  e->sum_i_q17 = 0;
  e->swing_v_q25 = 0;
}
