// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// What the drive reads from the chip at a control tick and what it asks of it: plain values, no registers.
#ifndef FL_CHIP_IO_H
#define FL_CHIP_IO_H

#include <stdbool.h>
#include <stdint.h>

#include "control/complex_fixed.h"
#include "names.h"
#include "settings_table.h"  // crossing_settings_t, words of the choices

#ifndef PHASES
#define PHASES 3  // or 5, by the build
#endif
#define SUBSPACES ((PHASES + 1) / 2 - 1)  // of the vector path; its arrays have room for those of five phases
#define CURRENT_CHANNELS (PHASES + 1)  // of the phases, idc
#define CODE_MIDDLE_Q4 (2048 * 16)     // of a current converter of 12 bits

typedef enum { LEG_OFF = 0, LEG_HIGH = 1, LEG_LOW = 2, LEG_PWM_HIGH = 3, LEG_PWM_LOW = 4 } leg_command_t;
typedef enum { SEQUENCER_OFF = 0, SEQUENCER_MANUAL = 1, SEQUENCER_SIX_STEP = 2 } sequencer_mode_t;

// Sample scheduler.
enum { SAMPLING_CONTINUOUS = 1, SAMPLING_RESTARTED = 2, SAMPLING_ONCE = 3 };

// What methods of driving the image holds, by the build: one that needs the room leaves some out. Bits by method_t, and the injection.
// A chip with five phases has no sequencer: its image leaves the six-step drive out.
#define HELD_INJECTION 4
#define HELD_ALL 7
#ifndef HELD
#define HELD (PHASES == 3 ? HELD_ALL : HELD_ALL & ~1)
#endif
static inline bool method_is_held(int32_t method, bool injects) {
  return HELD == HELD_ALL || ((HELD >> method & 1) != 0 && (!injects || (HELD & HELD_INJECTION) != 0));
}
// Of a method that is held.
static inline bool method_is_vector(int32_t method) { return (HELD & 1) == 0 || ((HELD & 2) != 0 && method == METHOD_VECTOR); }
static inline bool method_is_six_step(int32_t method) {
  return (HELD & 2) == 0 || ((HELD & 1) != 0 && method == METHOD_SIX_STEP);
}

// What the vector path measured, of the last regulator step before the tick. Vectors by subspace, d + jq.
typedef struct {
  complex_t i_q17[2];
  complex_t v_q17[2];      // applied; with several samples a tick only
  complex_t u_v_q25[2];    // state of the regulator
  complex_t v_sum_q17[2];  // applied ones of the steps since the tick before; with several samples a tick only
  uint32_t steps;
  uint32_t theta_sample_q32;  // with which i was turned; where asked for
  bool limited[2];
  bool taken;  // the set committed before took effect at this tick
  uint32_t encoder_position;  // at theta_sample, quarters
  bool encoder_indexed;
  uint16_t encoder_invalid;  // both tracks at once, wraps; with read_slow
  uint16_t encoder_strayed;  // index at another position than before, the same
} chip_vector_snapshot_t;

// Latest result of the injection (injection_error.h has the units), and its wave.
typedef struct {
  complex_t d;
  complex_t q;
  uint32_t count;
  uint16_t results;  // since reset, wraps
  uint16_t phase;    // of the wave at the latest sample, updates
  bool active;
} chip_injection_snapshot_t;

// A regulator step that waits for its voltage: subspace 1.
typedef struct {
  uint32_t number;
  complex_t i_q17;
} chip_direct_t;

// One coherent set of measurements, latched by the chip at the control tick.
typedef struct {
  uint32_t sample_number;
  int32_t v_q17[PHASES];  // terminal voltages
  int32_t i_q17[PHASES];  // phase currents; of METHOD_VECTOR with an injection only
  int32_t vdc_sum_q17;    // sums over the samples since the last tick
  int32_t idc_sum_q17;
  uint32_t sum_count;
  uint32_t zc_interval_cycles;  // last crossing interval
  uint32_t zc_period_cycles;    // last electrical period
  uint16_t crossings;           // counters since the commutation timer was switched on, they wrap
  uint16_t commutations;
  uint8_t late;    // overridden crossings that were not computed back
  uint8_t misses;  // consecutive
  uint8_t timeouts;
  uint8_t overdue;
  uint8_t trip_latched;  // TRIP_*
  uint8_t trip_first;
  uint8_t trip_monitor;  // MONITOR_*, with TRIP_DEADLINE
  uint32_t sector_interval_cycles[6];  // crossing intervals by the sector they ended in; only where asked for
  uint32_t hall_phase_cycles[6];       // from the last crossing to the edge into a sector; only where asked for
  struct {
    bool valid;     // the present code
    bool backward;  // the last edge was one of negative speed
    uint8_t sector;
    uint8_t driven;  // sector that the gates drive
    uint16_t edges;  // since reset, they wrap
    uint8_t invalid;
    uint8_t skipped;
    uint32_t phase_cycles;  // from the last crossing to the edge into sector
  } hall;
  bool auto_zero_busy;
  uint16_t current_code_offset_q4[CURRENT_CHANNELS];  // offsets in use, converter codes Q12.4
  chip_vector_snapshot_t vector;  // with METHOD_VECTOR only, which reads no crossings and sectors
  chip_injection_snapshot_t injection;  // with an injection only
} chip_snapshot_t;

// Freewheel measurements of a tick, in the chip's own words.
typedef struct {
  uint32_t sum_cycles;  // of those that ended
  uint32_t max;         // longest in bits 23..0, all ones: open; the sector it entered, 0..5, from bit 24
  uint32_t count;       // ended ones in bits 15..0; from bit 16 open ones: the next commutation came first
} chip_freewheel_t;

// Sections of what the chip is asked for, one a peripheral. Whoever owns a section sets `fresh`; the hardware layer
// writes what is fresh and clears it. What has no `fresh` is written at every tick.

// Gates, at once.
typedef struct {
  bool enable;
  bool clear_trips;
  bool start_auto_zero;  // measure the currents' offsets
  bool fresh;
} guard_command_t;

// A crossing that stays away for one and a half intervals after a commutation is missed.
#define COMMUTATION_TIMEOUT_Q12 0x1800u

// Six-step: sequencer, detector and commutation timer, as they mostly stay while the drive runs.
typedef struct {
  sequencer_mode_t sequencer;
  commutation_mode_t timer;
  leg_command_t leg[PHASES];
  uint32_t start_sector;
  uint32_t commutation;  // COMMUTATION_RSC..
  uint32_t pattern;      // PATTERN_ON_PWM..
  bool sync_rect;
  bool reverse;
  bool zcd_enable;
  crossing_settings_t crossing;
  uint32_t sampling;  // SAMPLING_*, at once
  uint32_t forced_interval_cycles;
  uint32_t miss_limit;  // 0: a lost lock is not reported
  bool force_on_miss;   // commutate after a timeout
  bool fresh;
} sequence_command_t;

// What the control loop moves.
typedef struct {
  uint32_t period_cycles;
  uint32_t pulse_cycles_q8;
  int32_t advance_q16;
  uint32_t peak_q17;  // amplitude of the open terminal about its threshold; 0: unknown
  uint32_t timeout_q12;  // patience with a crossing after a commutation, in the last interval
} loop_command_t;

// Thresholds of the crossings by sector. read: the next snapshot shall have the sectors' intervals.
typedef struct {
  int32_t q17[6];
  bool fresh;
  bool read;
} threshold_command_t;

// From the edge into a sector to the commutation. read: the next snapshot shall have intervals and phases.
typedef struct {
  int32_t q16[6];
  bool fresh;
  bool read;
} edge_command_t;

// Everything the six-step drive wants until the next tick. Takes effect together at that tick.
typedef struct {
  sequence_command_t sequence;
  loop_command_t loop;
  threshold_command_t threshold;
  edge_command_t edge;
} six_step_command_t;

// The vector path, by subspace.
typedef struct {
  bool enable;       // requests of the legs
  bool bypass;
  bool regulate[2];  // false: the regulator's state is the preset one
  complex_t preset_v_q17[2];
} control_command_t;

typedef struct {
  bool by_samples;  // else the tick is periodic
} tick_command_t;

typedef struct {
  complex_t i_q17[2];
} reference_command_t;

// As of complex_regulator.h.
typedef struct {
  complex_t gain[2];
  complex_t hold[2];
  complex_t ratio_q17[2];  // hold / gain
  uint32_t shift[2];
  uint32_t band_i_q17;  // without dead-time compensation
} gains_command_t;

typedef struct {
  complex_t v_q17[2];
} forward_command_t;

// Scale as of the modulator.
typedef struct {
  uint32_t v_q17[2];
  int32_t lead_q32;
  uint32_t scale;
  uint32_t scale_shift;
} limits_command_t;

// Lock-in and conventional method: the error is 2^4 times the true one.
#define INJECTION_SHIFT 4

typedef struct {
  bool inject;  // the wave runs
  bool clear;   // filters and sums begin anew, for what is left in them belongs to another frame
} injection_command_t;

// What the next snapshot shall have besides currents and voltages of the regulator.
typedef struct {
  bool angle;     // at every tick
  bool steps;     // with limited
  bool slow;      // sums, terminal voltages and the angle...
  bool currents;  // ...and the phase currents; with slow only
} look_command_t;

// Sections of the vector path's command that are fresh, a bit each: a step looks at one word instead of seven.
enum {
  FRESH_CONTROL = 1,
  FRESH_TICK = 2,
  FRESH_REFERENCE = 4,
  FRESH_LIMITS = 8,
  FRESH_GAINS = 16,
  FRESH_FORWARD = 32,
  FRESH_INJECTION = 64,
};

// Everything the vector drive wants until the next tick. Takes effect together at that tick.
typedef struct {
  uint32_t fresh;  // FRESH_*
  control_command_t control;
  tick_command_t tick;
  reference_command_t reference;
  gains_command_t gains;
  forward_command_t forward;
  limits_command_t limits;
  injection_command_t injection;
  look_command_t look;
  int32_t omega_turn_q36;
  int32_t correct_q32;  // added to the angle, once
} vector_command_t;

#endif
