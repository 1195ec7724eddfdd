// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/catch.h"

#include "control/fixed.h"
#include "control/placement.h"

SMALL_CODE_BEGIN

#define SQRT3_Q16 113512
#define QUARTER 0x40000000u
#define SIXTH_Q32 715827883u
#define STEP_MAX (INT32_MAX / 3 * 2)  // a third of a turn
#define STEP_TOLERANCE 357913942      // 30 degrees
#define CLIPPED_Q17 160               // five steps of a 12-bit converter

// atan(ratio) for 0..1 in Q15, 2^32 = one turn: r/8 + r (1 - r) (0.2447 + 0.0663 r) / (2 pi), to 0.09 degrees.
static uint32_t atan_turn(uint32_t ratio_q15) {
  const uint32_t bulge_q30 = ratio_q15 * (32768u - ratio_q15);
  const uint32_t factor_q15 = 1276u + ((346u * ratio_q15) >> 15);
  const uint32_t bent_q32 = (uint32_t)(((uint64_t)bulge_q30 * factor_q15) >> 13);
  return (ratio_q15 << 14) + bent_q32;
}

uint32_t vector_angle(int32_t x, int32_t y) {
  uint32_t ax = (uint32_t)abs_sat(x);
  uint32_t ay = (uint32_t)abs_sat(y);
  if (ax == 0u && ay == 0u) {
    return 0;
  }
  while ((ax | ay) >= 1u << 16) {
    ax >>= 1;
    ay >>= 1;
  }
  uint32_t angle = (ay <= ax) ? atan_turn((ay << 15) / ax) : QUARTER - atan_turn((ax << 15) / ay);
  if (x < 0) {
    angle = 2u * QUARTER - angle;
  }
  return (y < 0) ? 0u - angle : angle;
}

COLD int32_t catch_restore(const int32_t shown_q17[3], int32_t diode_q17, int32_t v_q17[3]) {
  uint32_t clipped = 0;
  int32_t sum = 0;
  int32_t highest = shown_q17[0];
  for (uint32_t x = 0; x < 3u; x++) {
    const bool low = shown_q17[x] < CLIPPED_Q17;
    clipped += low ? 1u : 0u;
    sum += low ? 0 : shown_q17[x];
    highest = (shown_q17[x] > highest) ? shown_q17[x] : highest;
  }
  if (clipped == 0u || clipped == 3u) {
    for (uint32_t x = 0; x < 3u; x++) {
      v_q17[x] = shown_q17[x];
    }
    return highest;
  }
  // What the clipped ones together lack to a sum of zero, as far as the diode of the lowest lets them; of two, one lies
  // at the diode's drop and the other one between that and zero.
  const bool one = clipped == 1u;
  const int32_t lowest = one ? -sum : -sum / 2;
  const bool held = lowest < -diode_q17;
  const int32_t filled = held ? (one ? -diode_q17 : -diode_q17 / 4 * 3) : lowest;
  for (uint32_t x = 0; x < 3u; x++) {
    v_q17[x] = (shown_q17[x] < CLIPPED_Q17) ? filled : shown_q17[x];
  }
  return highest - (held ? -diode_q17 : lowest);
}

void catch_reset(catch_t *rotor) { *rotor = (catch_t){0}; }

bool catch_step(catch_t *rotor, const int32_t v_q17[3], int32_t *mean_step) {
  const int32_t x = 2 * v_q17[0] - v_q17[1] - v_q17[2];
  const int32_t y = mul_q16(v_q17[1] - v_q17[2], SQRT3_Q16);
  const uint32_t angle = vector_angle(x, y);
  const int32_t step = (int32_t)(angle - rotor->angle);
  const int32_t change = step / 2 - rotor->step / 2;
  const bool agrees = abs_sat(step) < STEP_MAX && abs_sat(change) < STEP_TOLERANCE / 2 + abs_sat(step / 32);
  rotor->angle = angle;
  rotor->step = step;
  if (rotor->seen < 2u) {
    rotor->seen++;
    return false;
  }
  if (!agrees) {
    rotor->agreeing = 0;
    rotor->travel = 0;
    return false;
  }
  // A window that slides by halves: old steps fade.
  if (rotor->agreeing == 2u * CATCH_TICKS) {
    rotor->agreeing = CATCH_TICKS;
    rotor->travel /= 2;
  }
  rotor->agreeing++;
  rotor->travel += step / 64;
  *mean_step = rotor->travel / (int32_t)rotor->agreeing * 64;
  return rotor->agreeing >= CATCH_TICKS;
}

// Since the entry of sector index 0: theta' - 30 = arg + 60 degrees forward, 270 - theta' = -arg backward.
static uint32_t travelled_to(uint32_t arg, bool backward) { return backward ? 0u - arg : arg + CATCH_SIXTH; }

uint32_t catch_sector(uint32_t arg, bool backward) {
  const uint32_t travelled = travelled_to(arg, backward);
  uint32_t count = travelled / CATCH_SIXTH;
  if (travelled - count * CATCH_SIXTH > CATCH_MARGIN) {
    count++;
  }
  return (backward ? 12u - count : count) % 6u;
}

bool catch_begins(uint32_t arg, bool backward) {
  const uint32_t part = travelled_to(arg, backward) % CATCH_SIXTH;
  return part <= CATCH_MARGIN || part >= CATCH_SIXTH - CATCH_EARLY;
}

uint32_t catch_sector_cycles(int32_t mean_step, uint32_t tick_cycles) {
  // tick * 2^32 / (6 |step|), with a divisor of 30 bits.
  const uint32_t step = (uint32_t)abs_sat(mean_step) >> 2;
  const uint64_t sixth = ((uint64_t)tick_cycles * SIXTH_Q32) >> 2;
  return clamp_u32(div_sat_u32(sixth, step), 1u, 0xFFFFFFu);
}

SMALL_CODE_END
