// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "drive/six_step/measure.h"

#include "control/fixed.h"
#include "control/line_current.h"
#include "control/placement.h"
#include "control/speed.h"

// The counters of the commutation timer start anew when it leaves OFF; a snapshot taken at that very tick may still
// hold the old ones.
#define TIMER_SETTLED_TICKS 2u
#define CARRIERS_A_SECTOR 6u
#define ONE_Q16 65536
// A commutation so late does not come.
#define PLACE_MAX_Q16 (2 * ONE_Q16)
// Part of the way to the middle of what is known.
#define TO_MIDDLE 16
// 6.4 ms at 10 kHz.
#define MISS_WINDOW_TICKS 64u

HOT static int32_t filter(int32_t *state_q25, int32_t value_q17, int32_t shift) {
  *state_q25 += (value_q17 * 256 - *state_q25) >> shift;
  return *state_q25 >> 8;
}

// A sum of samples over their number, to the last bit. The number seldom changes.
HOT static int32_t mean(const measured_t *m, int32_t sum) {
  const int32_t magnitude = (int32_t)(((uint64_t)(uint32_t)abs_sat(sum) * m->one_over_count_q32) >> 32);
  return (sum < 0) ? -magnitude : magnitude;
}

void measure_init(measured_t *m, const parameters_t *p) {
  m->speed_numerator_q8 = speed_numerator_q8((uint32_t)p->clock_hz, (uint32_t)p->pole_pairs);
}

HOT static void measure_electric(measured_t *m, const parameters_t *p, const chip_snapshot_t *in,
                                 int32_t line_ratio_q16) {
  if (in->sum_count > 0u) {
    if (__builtin_expect(in->sum_count != m->sum_count, 0)) {
      m->sum_count = in->sum_count;
      m->one_over_count_q32 = UINT32_MAX / in->sum_count + 1u;
    }
    const int32_t vdc_q17 = clamp_i32(mean(m, in->vdc_sum_q17), 0, SAMPLE_MAX_Q17);
    m->vdc_v_q25 = vdc_q17 * 256;
    const int32_t idc_q17 = clamp_i32(mean(m, in->idc_sum_q17), -FULL_Q17, SAMPLE_MAX_Q17);
    m->idc_mean_q17 = idc_q17;
    m->idc_q17 = filter(&m->idc_filter_q25, idc_q17, CURRENT_FILTER_SHIFT);
    (void)filter(&m->loop_filter_q25, idc_q17, p->loop_filter_shift);
    m->line_i_q25 = line_current(m->loop_filter_q25, line_ratio_q16);
  }
  int32_t magnitude = 0;
  for (uint32_t x = 0; x < PHASES; x++) {
    magnitude += abs_sat(in->i_q17[x]);
  }
  m->motor_q17 = filter(&m->motor_filter_q25, magnitude / 2, CURRENT_FILTER_SHIFT);
}

// A sector needs pulses before and after its crossing: at least CARRIERS_A_SECTOR carriers, or as many as the
// carrier wanted by the user gives.
HOT static uint32_t longest_carrier(const parameters_t *p, const settings_t *settings, uint32_t zc_period_cycles) {
  const uint32_t wanted = settings->carrier_period_cycles;
  const uint32_t longest = (uint32_t)p->carrier_longest_cycles;
  const uint32_t allowed = zc_period_cycles / (6u * CARRIERS_A_SECTOR);
  return clamp_u32(allowed, wanted, (longest > wanted) ? longest : wanted);
}

HOT uint32_t measure_interval_cycles(const measured_t *m, uint32_t behind) {
  const uint32_t at = m->interval_at + behind;
  return m->interval_cycles[(at < TURN_INTERVALS) ? at : at - TURN_INTERVALS];
}

// Crossing intervals of rotors and inductances that are uneven repeat after half an electrical turn: their mean over it is
// as true as over the turn, at little more than half of the delay. Divider gains make halves unequal: correction B removes it.
HOT static uint32_t speed_period_cycles(measured_t *m, const parameters_t *p, const settings_t *settings,
                                        const chip_snapshot_t *in) {
  m->speed_short = settings->balance != BALANCE_NONE && m->sector_cycles > SHORT_TICKS * (uint32_t)p->tick_cycles;
  if (!m->speed_short) {
    return in->zc_period_cycles;
  }
  uint32_t half_cycles = 0;
  for (uint32_t k = 0; k < SHORT_INTERVALS; k++) {
    half_cycles += measure_interval_cycles(m, k);
  }
  return 2u * half_cycles;
}

HOT static void measure_speed(measured_t *m, const parameters_t *p, const settings_t *settings,
                              const chip_snapshot_t *in, uint32_t tick, bool timer_on) {
  if (!timer_on) {
    m->timer_on_ticks = 0;
    m->crossings = 0;
    m->commutations = 0;
    m->timeouts = 0;
    m->timeouts_before = 0;
    m->speed_valid = false;
    m->speed_fresh = false;
    m->speed_due = false;
    m->speed_rpm_q8 = 0;
    m->emf_v_q25 = 0;
    m->peak_q17 = 0;
    m->longest_cycles = (uint32_t)p->carrier_longest_cycles;
    return;
  }
  m->timer_on_ticks++;
  if (m->timer_on_ticks < TIMER_SETTLED_TICKS) {
    return;
  }
  if (tick % MISS_WINDOW_TICKS == 0u) {
    m->timeouts_before = m->timeouts;
    m->timeouts = in->timeouts;
  }
  const uint16_t crossings = (uint16_t)(in->crossings - (uint16_t)m->crossings);
  m->crossings += crossings;
  if (crossings > 0u) {
    m->interval_at = (m->interval_at > 0u) ? m->interval_at - 1u : TURN_INTERVALS - 1u;
    m->interval_cycles[m->interval_at] = in->zc_interval_cycles;
  }
  const uint16_t commutations = (uint16_t)(in->commutations - (uint16_t)m->commutations);
  m->commutations += commutations;
  // One that came within the last tick was no longer ago than that: what goes on from sector to sector is truer. While the
  // speed changes that stays at one end: it leans to the middle.
  const int32_t place_q16 = m->place_q16 + m->place_step_q16;
  if (commutations > 0u) {
    const int32_t since_q16 = clamp_i32(place_q16 - ONE_Q16, 0, m->place_step_q16);
    m->place_q16 = since_q16 + (m->place_step_q16 / 2 - since_q16) / TO_MIDDLE;
  } else {
    m->place_q16 = clamp_i32(place_q16, 0, PLACE_MAX_Q16);
  }
  m->speed_valid = m->speed_valid || m->crossings >= CROSSINGS_FOR_SPEED;
  m->speed_due = m->speed_due || crossings > 0u;
  // At most every second tick: at high speed crossings come in every one, and the other one is for the schedule.
  m->speed_fresh = m->speed_due && m->speed_valid && !m->speed_fresh;
  if (m->speed_fresh) {
    m->speed_due = false;
    m->longest_cycles = longest_carrier(p, settings, in->zc_period_cycles);
    m->sector_cycles = in->zc_period_cycles / 6u;
    m->place_step_q16 = (int32_t)(((uint32_t)p->tick_cycles << 16) / (m->sector_cycles + 1u));
    m->speed_rpm_q8 = speed_from_period_rpm_q8(m->speed_numerator_q8, speed_period_cycles(m, p, settings, in));
    m->emf_v_q25 = gain_apply(m->speed_rpm_q8, p->emf);
    m->peak_q17 = (uint32_t)clamp_i32(gain_apply(m->speed_rpm_q8, p->zcd_peak), 0, SAMPLE_MAX_Q17);
  }
}

HOT void measure_step(measured_t *m, const parameters_t *p, const settings_t *settings, const chip_snapshot_t *in,
                      uint32_t tick, bool timer_on, int32_t line_ratio_q16) {
  const uint32_t sampled_cycles = (in->sample_number - m->last_sample) * (uint32_t)p->sample_period_cycles;
  m->silent_ticks = (sampled_cycles < (uint32_t)p->tick_cycles / 2u) ? m->silent_ticks + 1u : 0u;
  m->last_sample = in->sample_number;
  measure_electric(m, p, in, line_ratio_q16);
  measure_speed(m, p, settings, in, tick, timer_on);
}
