// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Proof of Hall sensors by something that knows the rotor's angle without them: the EMF of a coasting rotor, or the sector
// that crossings drive.
//
// A look says how far the rotor is ahead of the middle of the sensors' sector. Sensors in their places leave it within half a
// sector and their misplacement, and the mean is the misplacement. Wires in a wrong order or inverted move the mean by a
// sector or more, or let the sectors run backward, so that many looks lie far off.
#ifndef FL_HALL_PROOF_H
#define FL_HALL_PROOF_H

#include <stdbool.h>
#include <stdint.h>

#define TURN_Q16 65536

typedef enum { HALL_UNPROVEN, HALL_RIGHT, HALL_WRONG } hall_verdict_t;

typedef struct {
  int32_t ahead_q16;   // sum of the looks
  uint32_t looks;
  uint32_t far;        // looks beyond 100 degrees
  uint32_t edges;
  uint32_t travel_q16; // of the rotor
} hall_proof_t;

void hall_proof_begin(hall_proof_t *proof);

// Rotor ahead of the middle of the sensors' sector, of a turn. emf_turn_q32: argument of the EMF; position: sector for
// positive speed. About 20 clocks.
int32_t hall_ahead_q16(uint32_t emf_turn_q32, bool backward, uint32_t position);

// A look. edges: since the look before; travel_q16: of the rotor, the same. HALL_RIGHT or HALL_WRONG after 16 looks and
// edges_wanted, or after four turns for fewer edges than that. About 30 clocks, 100 with a verdict.
hall_verdict_t hall_proof_step(hall_proof_t *proof, int32_t ahead_q16, uint32_t edges, uint32_t travel_q16,
                               uint32_t edges_wanted);

#endif
