// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// From the snapshot to the measured quantities of the six-step drive.
#ifndef FL_MEASURE_H
#define FL_MEASURE_H

#include "drive/method.h"

// Crossings after which the electrical period consists of real intervals.
#define CROSSINGS_FOR_SPEED 7u

// Over which the speed is a mean where correction B evens out what differs between rising and falling crossings.
#define SHORT_INTERVALS 3u
#define TURN_INTERVALS 6u
// Sectors so short may pass unseen between two ticks.
#define SHORT_TICKS 4u

// Measured quantities of the last tick.
typedef struct {
  int32_t vdc_v_q25;      // mean over the tick
  int32_t idc_q17;        // DC-link current, mean over the tick, filtered
  int32_t motor_q17;      // sum of the positive phase currents, filtered
  int32_t line_i_q25;     // current of the conducting pair from the DC-link current, filtered
  int32_t speed_rpm_q8;   // mechanical, magnitude, mean over the last electrical turn, or half of it
  int32_t emf_v_q25;      // of two phases at that speed
  bool speed_short;       // over half of the turn
  int32_t place_q16;       // in the sector, from its commutation on: 1 is the next one
  int32_t place_step_q16;  // a tick of it
  uint32_t interval_cycles[TURN_INTERVALS];  // before the crossings of a turn
  uint32_t interval_at;                      // the last one; the one before it comes behind it
  bool speed_valid;
  bool speed_fresh;  // measured in this tick
  bool speed_due;    // a crossing has come since
  uint32_t sector_cycles;   // mean crossing interval over the last electrical turn
  uint32_t longest_cycles;  // carrier period that still gives enough pulses in a sector
  uint32_t crossings;     // since the commutation timer was switched on, wraps after days
  uint32_t commutations;  // the same
  uint32_t timer_on_ticks;
  uint32_t sum_count;       // samples in the tick, and what divides by them
  uint32_t one_over_count_q32;
  uint32_t last_sample;
  uint32_t silent_ticks;  // consecutive ticks with less than half of their samples
  uint8_t timeouts;          // counter of the timer at the last boundary of 64 ticks
  uint8_t timeouts_before;   // and at the one before
  uint32_t peak_q17;  // amplitude of the open terminal about its threshold; 0: unknown
  int32_t idc_mean_q17;  // over the tick
  int32_t idc_filter_q25;
  int32_t motor_filter_q25;
  int32_t loop_filter_q25;
  uint64_t speed_numerator_q8;
} measured_t;

// Interval before the crossing that lies so many behind the last one, 0 to 5: 5 repeats itself as the next one.
uint32_t measure_interval_cycles(const measured_t *m, uint32_t behind);

void measure_init(measured_t *m, const parameters_t *p);

// Once a tick, before everything else. timer_on: the commutation timer runs; line_ratio_q16: current of the conducting pair
// over DC-link current. About 220 clocks, 250 more when a crossing came.
void measure_step(measured_t *m, const parameters_t *p, const settings_t *settings, const chip_snapshot_t *in,
                  uint32_t tick, bool timer_on, int32_t line_ratio_q16);

#endif
