// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/winding.h"

#include "control/fixed.h"
#include "control/placement.h"

#define LEAST_SAMPLES 64u
#define MOST_SAMPLES 2048u  // the sums have 32 bits
// Two turns change the signs of two lines by so much; of three by half as much again.
#define LEAST_CHANGES 8u
#define ALL_MOVED 7u
// Of the largest sum: 0.78 of the EMF. Two sums of whole phases that differ by 3 % are 0.88 of it.
#define SHORTED_PER_MILLE 600u

SMALL_CODE_BEGIN
void winding_reset(winding_t *winding) { *winding = (winding_t){0}; }

winding_verdict_t winding_step(winding_t *w, const int32_t v_q17[3], int32_t least_q17) {
  uint32_t signs = w->signs;
  for (uint32_t x = 0; x < 3u; x++) {
    const int32_t line_q10 = (v_q17[x] - v_q17[(x + 1u) % 3u]) >> 7;
    w->sum_q10[x] += (uint32_t)(line_q10 * line_q10);
    // A line without an EMF has no sign.
    if (abs_sat(line_q10) > least_q17 >> 7) {
      signs = (signs & ~(1u << x)) | ((line_q10 < 0) ? 1u << x : 0u);
    }
    w->first_q17[x] = (w->samples == 0u) ? v_q17[x] : w->first_q17[x];
    w->moved |= (abs_sat(v_q17[x] - w->first_q17[x]) > least_q17) ? 1u << x : 0u;
  }
  for (uint32_t changed = (w->samples == 0u) ? 0u : signs ^ w->signs; changed != 0u; changed &= changed - 1u) {
    w->changes++;
  }
  w->signs = signs;
  w->samples++;
  if (w->samples < MOST_SAMPLES && (w->samples < LEAST_SAMPLES || w->changes < LEAST_CHANGES)) {
    return WINDING_UNKNOWN;
  }
  uint32_t most = w->sum_q10[0];
  uint32_t least = most;
  for (uint32_t x = 1; x < 3u; x++) {
    most = (w->sum_q10[x] > most) ? w->sum_q10[x] : most;
    least = (w->sum_q10[x] < least) ? w->sum_q10[x] : least;
  }
  const bool unequal = (uint64_t)least * 1000u < (uint64_t)most * SHORTED_PER_MILLE;
  if (!unequal || w->moved != ALL_MOVED) {
    return WINDING_WHOLE;
  }
  if (w->doubted) {
    return WINDING_SHORTED;
  }
  *w = (winding_t){.doubted = true};
  return WINDING_UNKNOWN;
}
SMALL_CODE_END
