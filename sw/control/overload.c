// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/overload.h"

bool overload_step(overload_t *overload, const overload_settings_t *settings, int32_t i_q17, uint32_t ticks) {
  if (settings->ticks == 0u) {
    return false;
  }
  const int64_t rated_square = (int64_t)settings->rated_i_q17 * settings->rated_i_q17;
  const int64_t limit = 3 * rated_square * (int64_t)settings->ticks;
  const int64_t excess = (int64_t)i_q17 * i_q17 - rated_square;
  const int64_t heat = overload->heat + excess * (int64_t)ticks;
  const bool hot = heat > limit;
  // What is beyond the limit need not cool first: it is told once.
  overload->heat = (heat < 0) ? 0 : (hot ? limit : heat);
  return hot;
}
