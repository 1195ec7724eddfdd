// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Hand-over between injection and EMF observer, both ways, with a hysteresis of the speed.
//
//   |speed| above `up`, EMF there: the share s of the EMF rises to 1, then the injection is switched off
//   |speed| below `down`: the injection is switched on; after so many results s falls to 0
//
//   e = (1 - s) e_injection + s e_EMF        into one phase-locked loop
//
// Injection points to the saliency axis, which the cross-coupling puts c off the d axis, the EMF to the d axis. The frame
// rests at theta - (1 - s) c: references are turned, and the angle is published, with (1 - s) c.
#ifndef FL_INJECTION_HANDOVER_H
#define FL_INJECTION_HANDOVER_H

#include <stdbool.h>
#include <stdint.h>

typedef struct {
  int32_t up_turn_q36;    // electrical speed, > down
  int32_t down_turn_q36;  // > 0
  int32_t step_q16;       // change of s a step, > 0
  uint32_t results;       // of the injection, until it counts again
} injection_handover_settings_t;

typedef struct {
  int32_t share_q16;  // s, 0..2^16
  bool emf;           // s goes to 1
  bool inject;        // the injection is to be on
  uint32_t results;   // since it was switched on, saturates
} injection_handover_t;

// Start with the injection alone, or with the EMF alone.
void injection_handover_begin(injection_handover_t *state, bool emf);

// One step. fresh: the injection has a new result; emf_there: the EMF is large enough to count. About 40 clocks.
void injection_handover_step(injection_handover_t *state, const injection_handover_settings_t *settings,
                             int32_t speed_turn_q36, bool fresh, bool emf_there);

// e, of errors within +-1 in q30. About 30 clocks.
int32_t injection_handover_error_q30(const injection_handover_t *state, int32_t injection_q30, int32_t emf_q30);

// (1 - s) c.
int32_t injection_handover_curve_q32(const injection_handover_t *state, int32_t c_q32);

#endif
