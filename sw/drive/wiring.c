// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "drive/wiring.h"

#include "control/fixed.h"
#include "control/placement.h"
#include "hal/capture.h"

#define SLOT_TICKS 16u
#define REPEATS 4u
// What is set at a tick acts from between one and a half and three ticks later on: at these ticks, if three in a row are
// alike, the current is on its way to a peak, or has long been there in a machine whose current is quick.
#define UPPER_TICK 4u
#define LOWER_TICK 10u
// Records a tick: about 800 clocks.
#define RECORDS 8u
// Of the link's voltage, what a divider's error of gain may be: a quarter of half of it.
#define WIRING_GAIN_PART 8

SMALL_CODE_BEGIN
void wiring_begin(wiring_t *w) { *w = (wiring_t){0}; }

static int32_t pulse_sign(uint32_t at) { return (at >= 12u) ? 0 : ((at < 3u || at >= 9u) ? 1 : -1); }

static int32_t weight(uint32_t at) { return (at == UPPER_TICK) ? 1 : ((at == LOWER_TICK) ? -1 : 0); }

static int32_t largest(const int32_t m[WIRING_LEGS][WIRING_LEGS]) {
  int32_t most = 0;
  for (uint32_t k = 0; k < WIRING_LEGS; k++) {
    for (uint32_t j = 0; j < WIRING_LEGS; j++) {
      most = (abs_sat(m[k][j]) > most) ? abs_sat(m[k][j]) : most;
    }
  }
  return most;
}

// Every leg is seen by its own sensor, with its own sign, and the sum over the legs is larger so than in any other order:
// a saliency makes one leg's share small, never the sum.
static bool in_order(const int32_t m[WIRING_LEGS][WIRING_LEGS]) {
  static const uint8_t wrong[][WIRING_LEGS] = {{0, 2, 1}, {1, 0, 2}, {2, 1, 0}, {1, 2, 0}, {2, 0, 1}};
  const int32_t own = m[0][0] + m[1][1] + m[2][2];
  for (uint32_t order = 0; order < sizeof wrong / sizeof wrong[0]; order++) {
    int32_t other = 0;
    for (uint32_t k = 0; k < WIRING_LEGS; k++) {
      other += abs_sat(m[k][wrong[order][k]]);
      if (m[k][k] <= own / 12) {
        return false;
      }
    }
    if (other > own - own / 16) {
      return false;
    }
  }
  return true;
}

// The least of a divider is its error of gain: half of the link's voltage if it is dead. True: none is above the most.
static bool subtract_gain(int32_t m[WIRING_LEGS][WIRING_LEGS], int32_t most_q17) {
  bool fits = true;
  for (uint32_t j = 0; j < WIRING_LEGS; j++) {
    int32_t least = m[0][j];
    for (uint32_t k = 1; k < WIRING_LEGS; k++) {
      least = (m[k][j] < least) ? m[k][j] : least;
    }
    for (uint32_t k = 0; k < WIRING_LEGS; k++) {
      m[k][j] -= least;
    }
    fits = fits && least <= most_q17;
  }
  return fits;
}

// Sums to what a table shows.
static void scale(int32_t m[WIRING_LEGS][WIRING_LEGS], int32_t factor, int32_t parts) {
  for (uint32_t k = 0; k < WIRING_LEGS; k++) {
    for (uint32_t j = 0; j < WIRING_LEGS; j++) {
      m[k][j] = m[k][j] * factor / parts;
    }
  }
}

static wiring_verdict_t judge(wiring_t *w, bool voltages) {
  int32_t swing_q17[WIRING_LEGS][WIRING_LEGS];
  __builtin_memcpy(swing_q17, w->voltage_q17, sizeof swing_q17);
  const bool fits = subtract_gain(swing_q17, w->link_q17 / WIRING_GAIN_PART);
  w->known = true;
  w->passed = in_order(w->current_q17) && (!voltages || (fits && in_order(swing_q17)));
  return w->passed ? WIRING_RIGHT : WIRING_WRONG;
}

// Currents of a tick. True: they are known, or the voltage does not rise any more.
static bool look_at_currents(wiring_t *w, const chip_snapshot_t *in, int32_t peak_i_q17) {
  const uint32_t at = w->ticks % SLOT_TICKS;
  w->leg = w->ticks / SLOT_TICKS % WIRING_LEGS;
  w->sign = pulse_sign(at);
  for (uint32_t j = 0; j < WIRING_LEGS; j++) {
    w->current_q17[w->leg][j] += weight(at) * in->i_q17[j];
  }
  w->ticks++;
  if (w->ticks < REPEATS * WIRING_LEGS * SLOT_TICKS) {
    return false;
  }
  w->ticks = 0;
  scale(w->current_q17, 1, 2 * (int32_t)REPEATS);
  if (largest(w->current_q17) > peak_i_q17 / 4 || w->level + 1u == WIRING_LEVELS) {
    return true;
  }
  const uint32_t level = w->level + 1u;
  *w = (wiring_t){.level = level};
  return false;
}

static void read_voltages(wiring_t *w) {
  for (uint32_t n = 0; n < RECORDS; n++) {
    int32_t v_q10[WIRING_LEGS];
    int32_t most = INT32_MIN;
    int32_t least = INT32_MAX;
    int32_t sum = 0;
    for (uint32_t j = 0; j < WIRING_LEGS; j++) {
      v_q10[j] = capture_value(w->record, j) >> 7;
      most = (v_q10[j] > most) ? v_q10[j] : most;
      least = (v_q10[j] < least) ? v_q10[j] : least;
      sum += v_q10[j];
    }
    for (uint32_t j = 0; j < WIRING_LEGS; j++) {
      w->voltage_q17[w->leg][j] += abs_sat(v_q10[j] - (sum - most - least));
    }
    w->link_q17 = capture_value(w->record, WIRING_LEGS);
    w->record++;
  }
}

// Voltages of a tick. True: they are known.
static bool look_at_voltages(wiring_t *w) {
  const uint32_t records = capture_bytes() / CAPTURE_RECORD_BYTES;
  const uint32_t at = w->ticks % SLOT_TICKS;
  if (w->ticks == 0u) {
    capture_set_lanes(CAPTURE_TERMINALS);
    capture_configure(CAPTURE_AT_ONCE);
  }
  w->reads = w->reads || (w->ticks > 0u && at == 0u && records > 0u);
  w->sign = w->reads ? 0 : pulse_sign(at);
  w->ticks++;
  if (!w->reads) {
    return false;
  }
  read_voltages(w);
  if (w->record < records) {
    return false;
  }
  w->record = 0;
  w->ticks = 0;
  w->reads = false;
  w->leg++;
  return w->leg == WIRING_LEGS;
}

COLD wiring_verdict_t wiring_step(wiring_t *w, const chip_snapshot_t *in, int32_t peak_i_q17) {
  const uint32_t records = capture_depth();
  if (w->captures) {
    if (!look_at_voltages(w)) {
      return WIRING_TESTING;
    }
    scale(w->voltage_q17, 1 << 7, (int32_t)records);
    return judge(w, true);
  }
  if (!look_at_currents(w, in, peak_i_q17)) {
    return WIRING_TESTING;
  }
  w->leg = 0;
  w->sign = 0;
  w->captures = records > 0u;
  return w->captures ? WIRING_TESTING : judge(w, false);
}
SMALL_CODE_END
