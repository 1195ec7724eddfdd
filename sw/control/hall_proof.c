// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/hall_proof.h"

#include "control/catch.h"
#include "control/fixed.h"
#include "control/placement.h"

#define LOOKS_WANTED 16u
// 45 degrees: as far from the 29 that a sensor may be off as from the sector that a wire costs.
#define MEAN_MAX_Q16 (TURN_Q16 / 8)
#define FAR_Q16 (TURN_Q16 * 100 / 360)
// One look of so many beyond it.
#define FAR_SHARE 4u
#define TRAVEL_MAX_Q16 (4u * TURN_Q16)

COLD void hall_proof_begin(hall_proof_t *proof) { *proof = (hall_proof_t){0}; }

COLD int32_t hall_ahead_q16(uint32_t emf_turn_q32, bool backward, uint32_t position) {
  // The magnet lags the EMF by 90 degrees forward and leads it backward; the sector of position 0 begins at 210 degrees.
  const uint32_t travelled = emf_turn_q32 + (backward ? 4u : 1u) * CATCH_SIXTH;
  const uint32_t middle = position * CATCH_SIXTH + CATCH_SIXTH / 2u;
  return (int32_t)(travelled - middle) >> 16;
}

COLD hall_verdict_t hall_proof_step(hall_proof_t *proof, int32_t ahead_q16, uint32_t edges, uint32_t travel_q16,
                                    uint32_t edges_wanted) {
  proof->ahead_q16 += ahead_q16;
  proof->looks++;
  proof->far += (abs_sat(ahead_q16) > FAR_Q16) ? 1u : 0u;
  proof->edges += edges;
  proof->travel_q16 += travel_q16;
  if (proof->edges < edges_wanted || proof->looks < LOOKS_WANTED) {
    return (proof->travel_q16 > TRAVEL_MAX_Q16 && proof->looks >= LOOKS_WANTED) ? HALL_WRONG : HALL_UNPROVEN;
  }
  const bool off = abs_sat(proof->ahead_q16) > MEAN_MAX_Q16 * (int32_t)proof->looks;
  return (off || proof->far * FAR_SHARE > proof->looks) ? HALL_WRONG : HALL_RIGHT;
}
