// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "drive/wiring.h"

#include "control/fixed.h"
#include "control/placement.h"
#include "hal/capture.h"
#include "hal/chip.h"

#define SLOT_TICKS 16u
#define REPEATS 4u
// What is set at a tick acts from between one and a half and three ticks later on: at these ticks, if three in a row are
// alike, the current is on its way to a peak, or has long been there in a machine whose current is quick.
#define UPPER_TICK 4u
#define LOWER_TICK 10u
// Of a tick: the last record begins before five eighths of it have passed, and no more than so many clocks each.
#define READING_EIGHTHS 5u
#define RECORD_CYCLES 150u
// Of the link's voltage, what a divider's error of gain may be: a quarter of half of it.
#define GAIN_PART 8
// Of the sum of the legs' own, the least that each must have: a saliency makes a current small, never a voltage.
#define CURRENT_PART 12
#define VOLTAGE_PART 6
// Samples that must have seen a moved edge before a table of voltages tells anything.
#define HITS 12
#define VOLTAGE_SHIFT 7u

SMALL_CODE_BEGIN
void wiring_begin(wiring_t *w) { *w = (wiring_t){0}; }

// Three ticks up, six down, three up, four without; of the voltages one, two and one.
static int32_t pulse_sign(uint32_t at, uint32_t length) {
  const uint32_t part = at / length % 4u;
  return (at >= 4u * length && length > 1u) ? 0 : ((part == 0u || part == 3u) ? 1 : -1);
}

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

static int32_t own_sum(const int32_t m[WIRING_LEGS][WIRING_LEGS]) { return m[0][0] + m[1][1] + m[2][2]; }

// Largest sum that another order of the sensors would have, whatever their signs.
static int32_t other_sum(const int32_t m[WIRING_LEGS][WIRING_LEGS]) {
  static const uint8_t wrong[][WIRING_LEGS] = {{0, 2, 1}, {1, 0, 2}, {2, 1, 0}, {1, 2, 0}, {2, 0, 1}};
  int32_t most = 0;
  for (uint32_t order = 0; order < sizeof wrong / sizeof wrong[0]; order++) {
    int32_t other = 0;
    for (uint32_t k = 0; k < WIRING_LEGS; k++) {
      other += abs_sat(m[k][wrong[order][k]]);
    }
    most = (other > most) ? other : most;
  }
  return most;
}

// Every leg is seen by its own sensor, with its own sign, and the sum over the legs is larger so than in any other order:
// a saliency makes one leg's share small, never the sum.
static bool in_order(const int32_t m[WIRING_LEGS][WIRING_LEGS], int32_t part) {
  const int32_t own = own_sum(m);
  bool seen = true;
  for (uint32_t k = 0; k < WIRING_LEGS; k++) {
    seen = seen && m[k][k] > own / part;
  }
  return seen && other_sum(m) <= own - own / 16;
}

// The least of a divider is its error of gain: half of the link's voltage if it is dead. True: none is above the most.
static bool subtract_gain(int32_t m[WIRING_LEGS][WIRING_LEGS], int32_t highest) {
  bool fits = true;
  for (uint32_t j = 0; j < WIRING_LEGS; j++) {
    int32_t least = m[0][j];
    for (uint32_t k = 1; k < WIRING_LEGS; k++) {
      least = (m[k][j] < least) ? m[k][j] : least;
    }
    for (uint32_t k = 0; k < WIRING_LEGS; k++) {
      m[k][j] -= least;
    }
    fits = fits && least <= highest;
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

static wiring_verdict_t verdict_of(wiring_t *w, bool right) {
  w->known = true;
  w->captures = false;
  w->passed = right;
  return right ? WIRING_RIGHT : WIRING_WRONG;
}

// After a round of captures. What is neither right nor wrong by far gets another one; after the last the dividers are not
// seen: this machine bears only pulses that are too short for the samples.
static wiring_verdict_t judge_voltages(wiring_t *w, uint32_t records, uint32_t most_ticks) {
  const int32_t link_q10 = w->link_q17 >> VOLTAGE_SHIFT;
  int32_t swing_q10[WIRING_LEGS][WIRING_LEGS];
  __builtin_memcpy(swing_q10, w->voltage_q17, sizeof swing_q10);
  const int32_t gain_q10 = (int32_t)(records * w->round) / GAIN_PART * link_q10;
  const bool fits = subtract_gain(swing_q10, gain_q10) && w->middle_q10 > gain_q10;
  const bool seen = largest(swing_q10) > HITS * link_q10;
  const bool right = fits && seen && in_order(swing_q10, VOLTAGE_PART);
  const bool wrong = !fits || (seen && other_sum(swing_q10) > 2 * own_sum(swing_q10));
  if (!right && !wrong && w->round < WIRING_ROUNDS && w->all_ticks < most_ticks) {
    return WIRING_TESTING;
  }
  scale(w->voltage_q17, (right || wrong) ? 1 << VOLTAGE_SHIFT : 0, (int32_t)(records * w->round));
  return verdict_of(w, !wrong && in_order(w->current_q17, CURRENT_PART));
}

// Currents of a tick. True: they are known, or the voltage does not rise any more.
static bool look_at_currents(wiring_t *w, const chip_snapshot_t *in, int32_t peak_i_q17) {
  const uint32_t at = w->ticks % SLOT_TICKS;
  w->leg = w->ticks / SLOT_TICKS % WIRING_LEGS;
  w->sign = pulse_sign(at, WIRING_CURRENT_TICKS);
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
  const wiring_t next = {.level = w->level + 1u, .all_ticks = w->all_ticks};
  *w = next;
  return false;
}

static void read_voltages(wiring_t *w, uint32_t records, uint32_t tick_cycles) {
  const uint32_t end = chip_tick_time() + tick_cycles * READING_EIGHTHS / 8u;
  const uint32_t most = tick_cycles / RECORD_CYCLES;
  for (uint32_t n = 0; n < most && w->record < records && (int32_t)(chip_now() - end) < 0; n++) {
    int32_t v_q17[WIRING_LEGS + 1u];
    capture_look(w->record, v_q17);
    const int32_t high_q17 = (v_q17[0] > v_q17[1]) ? v_q17[0] : v_q17[1];
    const int32_t low_q17 = (v_q17[0] > v_q17[1]) ? v_q17[1] : v_q17[0];
    const int32_t middle_q17 = clamp_i32(v_q17[2], low_q17, high_q17);
    for (uint32_t j = 0; j < WIRING_LEGS; j++) {
      w->voltage_q17[w->leg][j] += abs_sat(v_q17[j] - middle_q17) >> VOLTAGE_SHIFT;
    }
    w->middle_q10 += middle_q17 >> VOLTAGE_SHIFT;
    w->link_q17 = v_q17[WIRING_LEGS];
    w->record++;
  }
}

// Voltages of a tick. True: they are known.
static bool look_at_voltages(wiring_t *w, uint32_t tick_cycles) {
  const uint32_t records = capture_bytes() / CAPTURE_RECORD_BYTES;
  const uint32_t at = w->ticks % SLOT_TICKS;
  if (w->ticks == 0u) {
    capture_set_lanes(CAPTURE_TERMINALS);
    capture_configure(CAPTURE_AT_ONCE);
  }
  w->reads = w->reads || (w->ticks > 0u && at == 0u && records > 0u);
  w->sign = w->reads ? 0 : pulse_sign(at, WIRING_VOLTAGE_TICKS);
  w->ticks++;
  if (!w->reads) {
    return false;
  }
  read_voltages(w, records, tick_cycles);
  if (w->record < records) {
    return false;
  }
  w->record = 0;
  w->ticks = 0;
  w->reads = false;
  w->leg++;
  return w->leg == WIRING_LEGS;
}

COLD wiring_verdict_t wiring_step(wiring_t *w, const parameters_t *p, const chip_snapshot_t *in, int32_t peak_i_q17) {
  const uint32_t records = capture_depth();
  const uint32_t tick_cycles = (uint32_t)p->tick_cycles;
  w->all_ticks++;
  if (w->captures) {
    if (!look_at_voltages(w, tick_cycles)) {
      return WIRING_TESTING;
    }
    w->leg = 0;
    w->round++;
    return judge_voltages(w, records, (uint32_t)p->clock_hz / (WIRING_PARTS * tick_cycles));
  }
  if (!look_at_currents(w, in, peak_i_q17)) {
    return WIRING_TESTING;
  }
  w->leg = 0;
  w->sign = 0;
  w->captures = records > 0u;
  return w->captures ? WIRING_TESTING : verdict_of(w, in_order(w->current_q17, CURRENT_PART));
}
SMALL_CODE_END
