// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// A segment of the commissioning: voltage or current in a frame that turns at a set speed, for a number of control
// ticks, and sums of what was measured, block by block.
//
// Voltage: v + s[k] w in the frame, s = + + - - from tick to tick: the part w is a triangle of current, from whose corners
// the inductance follows. Current: the hardware's regulators at i*, g = re + j cross omega, h real. Speed: goes to its
// target by a set step a tick. What is set at tick k acts between the samples of ticks k + 2 and k + 3 (two samples a
// tick, T_d = T_s).
#ifndef FL_SEGMENT_H
#define FL_SEGMENT_H

#include <stdbool.h>
#include <stdint.h>

#include "hal/chip_io.h"
#include "params.h"

#define BLOCK_TICKS_MAX 512u
#define BLOCKS 8u  // that wait to be told

typedef enum { SEGMENT_OFF, SEGMENT_VOLTAGE, SEGMENT_CURRENT } segment_mode_t;

typedef struct {
  segment_mode_t mode;
  complex_t voltage_v_q17;
  complex_t alternate_v_q17;
  complex_t reference_i_q17;
  complex_t gain;    // re: g, im: h; mantissas, regulator_design.h
  int32_t cross_q30;  // imaginary part of g over the speed in 2^-36 turn a clock
  uint32_t shift;
  uint32_t scale, scale_shift, limit_v_q17;
  int32_t target_turn_q44;  // 2^-44 turn a clock
  int32_t step_turn_q44;    // a tick
  uint32_t patience_ticks;  // without a line, before the gates go off; 0: for ever
} segment_settings_t;

// Sums over a block; corner and middle: samples 0, 1 of the four of a period of s less those two ticks later.
typedef struct {
  uint32_t ticks;
  complex_t i_q17, corner_i_q17, middle_i_q17;
  complex_t v_q17;  // applied, a carrier each
  uint32_t steps;   // carriers in v
  int32_t vdc_q21;
  complex_t last_i_q17;
  int32_t omega_turn_q36;  // at the end
  int32_t last_turn_q32;   // angle of the frame at its last sample
} block_t;

typedef struct {
  segment_settings_t set;
  int32_t omega_turn_q44;
  int32_t turn_q32;  // to be added to the angle
  uint32_t lead_cycles;
  uint32_t tick;
  uint32_t left_ticks, block_ticks;
  block_t sum;
  block_t block[BLOCKS];
  uint32_t head, tail;
  bool lost;  // a block came while BLOCKS waited
  uint8_t trip;
  uint32_t silent_ticks;  // driven without a segment
  bool forsaken;          // for longer than the patience: off until the host has said so itself
  guard_command_t guard;
  vector_command_t command;
} segment_t;

// Gates off. Angle and speed from 0.
void segment_init(segment_t *segment, const parameters_t *parameters);
// Blocks of `block` ticks for `ticks` ticks from now on; 1 <= block <= BLOCK_TICKS_MAX.
void segment_run(segment_t *segment, uint32_t ticks, uint32_t block);
// The control step: what was measured, and the command for the next tick.
void segment_step(segment_t *segment, const chip_snapshot_t *in);

#endif
