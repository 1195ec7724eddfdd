// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Whether legs, current sensors and voltage dividers belong together, before the first turn.
//
// Each leg in turn gets small pulses against the others, three control ticks up, six down, three up: the current is a triangle
// up and one down, whose impulses cancel, and the rotor stays. Of a current sensor counts what it sees in the upper one less
// what it sees in the lower one, so offsets do not; of a divider, in a capture at full rate, by how much it stands out of the other
// two: it does while its leg alone has switched. The voltage rises until a sensor sees the current. The dividers get shorter and
// higher pulses of their own, and captures until the tables tell, or a stated number of them that they cannot.
//
// The test only says right or wrong; what is wrong follows from the two tables (sim/fluxlock/wiring).
#ifndef FL_WIRING_H
#define FL_WIRING_H

#include <stdbool.h>
#include <stdint.h>

#include "drive/parameters.h"
#include "hal/chip_io.h"

#define WIRING_LEGS 3u
// Of both tables, with which wiring_t begins.
#define WIRING_TABLE_BYTES (2u * WIRING_LEGS * WIRING_LEGS * 4u)
// Levels of the voltage, each one and a half times the one before: the first is meant to do.
#define WIRING_LEVELS 5u
#define WIRING_CURRENT_TICKS 3
#define WIRING_VOLTAGE_TICKS 1
// Captures of each leg, if there is time: no round begins after so many parts of a second, so that with the coast before and the
// last round it is over after 200 ms.
#define WIRING_ROUNDS 9u
#define WIRING_PARTS 10u

// By how much the samples' grid is shifted from tick to tick and from round to round, clocks: in step with the carrier it never
// sees an edge that moves by less than a sample's period; so it sees each clock of it in turn.
#define WIRING_SHIFT_CYCLES 7u
#define WIRING_ROUND_CYCLES 3u

typedef enum { WIRING_TESTING, WIRING_RIGHT, WIRING_WRONG } wiring_verdict_t;

typedef struct {
  int32_t current_q17[WIRING_LEGS][WIRING_LEGS];  // by leg and sensor, half of upper less lower
  int32_t voltage_q17[WIRING_LEGS][WIRING_LEGS];  // by leg and divider, mean over the captures; 0: not seen
  int32_t middle_q10;  // sum of the middle one of the three, which follows the link half of the time
  int32_t link_q17;    // its voltage, of the last record
  uint32_t ticks;   // of the level, or of the leg whose voltages are looked at
  uint32_t all_ticks;
  uint32_t level;   // of the voltage, 0 ..
  uint32_t round;   // of the captures, 0 ..
  uint32_t leg;     // that pulses now
  int32_t sign;     // of its pulse: 1, -1, 0
  uint32_t record;  // of the capture, the next one
  bool captures;    // the voltages
  bool reads;       // the capture is complete
  bool known;       // both tables are
  bool passed;      // since boot
} wiring_t;

void wiring_begin(wiring_t *wiring);

// By how much the samples are to be later at the next tick, clocks below their period.
static inline uint32_t wiring_shift_cycles(const wiring_t *wiring, uint32_t period_cycles) {
  const uint32_t shift_cycles = wiring->ticks * WIRING_SHIFT_CYCLES + wiring->round * WIRING_ROUND_CYCLES;
  return wiring->captures ? shift_cycles % period_cycles : 0u;
}

// A tick: looks at the snapshot, then leg and sign say the next pulse; with a verdict there is none. peak_i_q17: wanted.
wiring_verdict_t wiring_step(wiring_t *wiring, const parameters_t *p, const chip_snapshot_t *in, int32_t peak_i_q17);

#endif
