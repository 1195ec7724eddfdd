// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "drive/six_step/hall.h"

#include "control/fixed.h"
#include "control/hall_offset.h"
#include "control/placement.h"

// A code that stays invalid that long is no glitch.
#define INVALID_TICKS 3u
// An invalid code or a skipped sector weighs as much as so many good edges. One glitch is none; a sensor that is stuck
// gives three such events in four edges.
#define SUSPICION_STEP 8u
#define SUSPICION_LIMIT 32u
// One crossing that lies 20 degrees or more apart from its edge is enough: the next ones drive current against the EMF.
#define APART_Q16 21845
// An over-current that soon after the edges took over is the crossings' doing.
#define AFTERMATH_TICKS 50u
#define MISSES_LOST 2u
// The crossings are back when they agree within 5 degrees for ten turns.
#define AGREEING_Q16 5461
#define AGREEING_EDGES 60u
#define DRIVING_TICKS 200u
// Learning: largest change of the period from turn to turn as a power of two, weight of a turn, and how far crossings
// and intervals may tell different stories (3 degrees) for the crossings to be believed.
#define STEADY_SHIFT 9
#define LEARN_SHIFT 3
#define STORY_Q16 3277
#define EDGES_A_TURN 7u
#define LATE_MAX_Q20 ((HALL_LATE_MAX_Q16) << 4)

typedef enum { STAGE_WAIT, STAGE_TAKE, STAGE_SECTOR, STAGE_DONE = STAGE_SECTOR + SECTORS } stage_t;

static int32_t late_q16(const hall_t *h, bool reverse, uint32_t sector) {
  return h->late_q20[reverse ? 1 : 0][sector] / 16;
}

COLD static void write_offsets(const hall_t *h, edge_command_t *command, bool reverse) {
  for (uint32_t s = 0; s < SECTORS; s++) {
    command->q16[s] = -late_q16(h, reverse, s);
  }
  command->fresh = true;
}

static void wait_for_turn(hall_t *h) {
  h->stage = STAGE_WAIT;
  h->turn_from = h->edge_count;
}

COLD void hall_init(hall_t *h, const parameters_t *p) {
  *h = (hall_t){0};
  for (uint32_t s = 0; s < SECTORS; s++) {
    h->late_q20[0][s] = p->hall_late_q16[s] * 16;
  }
  hall_mirror(h->late_q20[0], true, h->late_q20[1]);
}

HOT void hall_judge(hall_t *h, const chip_snapshot_t *in) {
  const uint32_t edges = (uint16_t)(in->hall.edges - h->edges);
  const uint32_t bad = (uint32_t)(uint8_t)(in->hall.invalid - h->invalid) + (uint8_t)(in->hall.skipped - h->skipped);
  h->edges = in->hall.edges;
  h->invalid = in->hall.invalid;
  h->skipped = in->hall.skipped;
  h->backward = in->hall.backward;
  h->invalid_ticks = in->hall.valid ? 0u : h->invalid_ticks + 1u;
  if (!h->seen) {
    h->seen = true;
    return;
  }
  h->edge_count += edges;
  h->still_ticks = (edges > 0u) ? 0u : h->still_ticks + 1u;
  if (bad > 0u) {
    h->suspicion = clamp_u32(h->suspicion + bad * SUSPICION_STEP, 0, 2u * SUSPICION_LIMIT);
  } else if (h->suspicion > 0u) {
    h->suspicion -= clamp_u32(edges, 0, h->suspicion);
  }
  if (h->suspicion >= SUSPICION_LIMIT || h->invalid_ticks >= INVALID_TICKS) {
    h->faulty = true;
  } else if (h->suspicion == 0u && h->invalid_ticks == 0u) {
    h->faulty = false;
  }
}

COLD void hall_begin(hall_t *h, edge_command_t *command, const parameters_t *p, bool reverse) {
  if (p->hall_mode == HALL_OFF) {
    return;
  }
  h->driving = p->hall_mode == HALL_SENSORED || (h->driving && !h->faulty);
  h->apart = false;
  h->agreeing = 0;
  h->driving_ticks = 0;
  wait_for_turn(h);
  const uint32_t way = reverse ? 1u : 0u;
  if (!h->learnt[way] && h->learnt[1u - way]) {
    hall_mirror(h->late_q20[1u - way], reverse, h->late_q20[way]);
  }
  write_offsets(h, command, reverse);
}

COLD void hall_resort(hall_t *h, const parameters_t *p) { h->driving = p->hall_mode != HALL_OFF; }

COLD void hall_forget(hall_t *h) { h->driving = false; }

bool hall_backs_up(const hall_t *h, const parameters_t *p) {
  return h->driving || (p->hall_mode == HALL_FALLBACK && !h->faulty);
}

bool hall_blames_crossings(const hall_t *h, const parameters_t *p) {
  return p->hall_mode == HALL_FALLBACK && !h->faulty && (h->driving ? h->driving_ticks < AFTERMATH_TICKS : h->apart);
}

bool hall_rotor_slow(const hall_t *h, const parameters_t *p) { return h->still_ticks > (uint32_t)p->hall_calm_ticks; }

bool hall_rotor_stalled(const hall_t *h, const parameters_t *p) {
  return h->driving && h->still_ticks > (uint32_t)p->hall_stall_ticks;
}

uint32_t hall_interval_cycles(const hall_t *h, const six_step_view_t *view, bool reverse, uint32_t from_edges) {
  if (h->edge_count - from_edges < 3u || h->backward != reverse) {
    return 0;
  }
  const uint32_t still_cycles = clamp_u32(h->still_ticks, 0, 0xFFFu) * (uint32_t)view->p->tick_cycles;
  return clamp_u32(view->in->zc_interval_cycles, still_cycles, 0xFFFFFFu);
}

COLD static hall_advice_t take_over(hall_t *h) {
  h->driving = true;
  h->driving_ticks = 0;
  h->agreeing = 0;
  h->handovers++;
  return HALL_TAKE_OVER;
}

COLD static hall_advice_t give_back(hall_t *h) {
  h->driving = false;
  h->apart = false;
  return HALL_GIVE_BACK;
}

// The last edge against the crossing before it. Where the codes raise suspicion it is the edge that is wrong.
HOT static void compare(hall_t *h, const six_step_view_t *view, bool reverse) {
  const chip_snapshot_t *in = view->in;
  if (h->edge_count == h->judged_edges || view->m->sector_cycles == 0u) {
    return;
  }
  h->judged_edges = h->edge_count;
  if (h->suspicion > 0u) {
    h->agreeing = 0;
    h->apart = false;
    return;
  }
  const int32_t late = hall_late_from_phase_q16(in->hall.phase_cycles, 6u * view->m->sector_cycles);
  const int32_t distance = abs_sat(late - late_q16(h, reverse, in->hall.sector));
  h->agreeing = (distance < AGREEING_Q16) ? h->agreeing + 1u : 0u;
  h->apart = distance >= APART_Q16;
}

// Fallback: who commutates.
HOT static hall_advice_t hand_over(hall_t *h, const six_step_view_t *view, bool reverse) {
  compare(h, view, reverse);
  if (h->driving) {
    h->driving_ticks++;
    return (h->agreeing >= AGREEING_EDGES && h->driving_ticks > DRIVING_TICKS) ? give_back(h) : HALL_KEEP;
  }
  const bool lost = view->in->misses >= MISSES_LOST || (h->apart && h->learnt[reverse ? 1 : 0]);
  return (!h->faulty && lost) ? take_over(h) : HALL_KEEP;
}

// Lateness by the intervals of the edges, where they are what is measured.
COLD static bool take(hall_t *h, const chip_snapshot_t *in, bool reverse) {
  const uint32_t period = in->zc_period_cycles;
  const uint32_t change = (period > h->period_cycles) ? period - h->period_cycles : h->period_cycles - period;
  h->period_cycles = period;
  interval_lateness(in->sector_interval_cycles, reverse, h->late_x6);
  for (uint32_t s = 0; s < SECTORS; s++) {
    h->target_q16[s] = (int32_t)clamp_u32(in->hall_phase_cycles[s], 0, 0xFFFFFFu);
  }
  return change <= period >> STEADY_SHIFT && h->suspicion == 0u;
}

// Lateness of one edge by the intervals and by the crossings, in the places of what they are made of.
COLD static void compare_sector(hall_t *h, uint32_t s) {
  h->late_x6[s] = hall_late_from_intervals_q16(h->late_x6[s], h->period_cycles);
  h->target_q16[s] = hall_late_from_phase_q16((uint32_t)h->target_q16[s], h->period_cycles);
}

// Both stories put together: the edges' own intervals, and the lag common to all from the crossings if these agree; the
// crossings alone while they commutate. False: nothing to learn from.
COLD static bool conclude(hall_t *h, bool reverse) {
  const int32_t *known = h->late_q20[reverse ? 1 : 0];
  int32_t crossing_sum = 0;
  int32_t known_sum = 0;
  bool believed = true;
  for (uint32_t s = 0; s < SECTORS; s++) {
    believed = believed && abs_sat(h->target_q16[s]) <= HALL_LATE_MAX_Q16 * 9 / 10;
    crossing_sum += h->target_q16[s];
    known_sum += known[s] / 16;
  }
  if (!h->driving) {
    return believed;
  }
  for (uint32_t s = 0; s < SECTORS; s++) {
    const int32_t apart = h->target_q16[s] - crossing_sum / (int32_t)SECTORS - h->late_x6[s];
    believed = believed && abs_sat(apart) < STORY_Q16;
  }
  for (uint32_t s = 0; s < SECTORS; s++) {
    h->target_q16[s] = h->late_x6[s] + (believed ? crossing_sum : known_sum) / (int32_t)SECTORS;
  }
  return true;
}

COLD static void learn(hall_t *h, edge_command_t *command, bool reverse) {
  const uint32_t way = reverse ? 1u : 0u;
  for (uint32_t s = 0; s < SECTORS; s++) {
    int32_t *late = &h->late_q20[way][s];
    const int32_t error = h->target_q16[s] * 16 - *late;
    *late = clamp_i32(*late + (h->learnt[way] ? error / (1 << LEARN_SHIFT) : error), -LATE_MAX_Q20, LATE_MAX_Q20);
  }
  h->learnt[way] = true;
  write_offsets(h, command, reverse);
}

COLD static void learn_stage(hall_t *h, edge_command_t *command, const chip_snapshot_t *in, bool reverse) {
  switch (h->stage) {
    case STAGE_TAKE:
      h->stage = STAGE_SECTOR;
      if (!take(h, in, reverse)) {
        wait_for_turn(h);
      }
      break;
    case STAGE_DONE:
      if (conclude(h, reverse)) {
        learn(h, command, reverse);
      }
      wait_for_turn(h);
      break;
    default:
      compare_sector(h, h->stage - STAGE_SECTOR);
      h->stage++;
      break;
  }
}

HOT hall_advice_t hall_step(hall_t *h, edge_command_t *command, const six_step_view_t *view, bool reverse) {
  const hall_advice_t advice =
      (view->p->hall_mode == HALL_FALLBACK) ? hand_over(h, view, reverse) : HALL_KEEP;
  command->read = false;
  if (!view->settings->hall_learn || view->settings->freeze) {
    return advice;
  }
  if (h->stage != STAGE_WAIT) {
    learn_stage(h, command, view->in, reverse);
  } else if (h->edge_count - h->turn_from > EDGES_A_TURN) {
    command->read = true;
    h->stage = STAGE_TAKE;
  }
  return advice;
}
