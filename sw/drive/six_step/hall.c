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
// Proof: edges with open gates, and while the crossings commutate; tries with open gates; margin over the voltage at which a
// coasting rotor is seen.
#define EDGES_COASTING 3u
#define EDGES_CROSSED 12u
#define TRIALS_MAX 3u
#define LOOKS_MAX 60000u
#define SEEN_SHIFT 2
#define TURN_EDGES 6
// A pull: so many edges backward while the rotor stays where it is.
#define SWINGS 4u
// Sectors at the middle of which the two alignments hold the rotor.
#define PATIENCE_SHARE 6
#define ALIGNED_FIRST 2
#define ALIGNED_SECOND 4
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

static int32_t lesser(int32_t a, int32_t b) { return (a < b) ? a : b; }
static int32_t greater(int32_t a, int32_t b) { return (a > b) ? a : b; }

// From one sector to another, -3 to 2.
static int32_t sectors_from(uint32_t from, uint32_t to) { return (int32_t)((to + 9u - from) % SECTORS) - 3; }

static uint32_t position_of(uint32_t sector, bool reverse) { return reverse ? (sector + 3u) % SECTORS : sector; }

HOT void hall_judge(hall_t *h, const chip_snapshot_t *in, bool reverse) {
  const uint32_t edges = (uint16_t)(in->hall.edges - h->edges);
  const uint32_t bad = (uint32_t)(uint8_t)(in->hall.invalid - h->invalid) + (uint8_t)(in->hall.skipped - h->skipped);
  h->edges = in->hall.edges;
  h->invalid = in->hall.invalid;
  h->skipped = in->hall.skipped;
  h->backward = in->hall.backward;
  const uint32_t before = h->sector;
  h->sector = in->hall.sector;
  h->invalid_ticks = in->hall.valid ? 0u : h->invalid_ticks + 1u;
  if (!h->seen) {
    h->seen = true;
    return;
  }
  h->edge_count += edges;
  h->new_edges = edges;
  if (edges > 0u) {
    const int32_t moved = sectors_from(before, h->sector);
    const int32_t along = reverse ? -moved : moved;
    h->net = lesser(h->net + along, TURN_EDGES);
    h->contrary += ((int32_t)edges > along) ? (uint32_t)((int32_t)edges - along) / 2u : 0u;
  }
  h->still_ticks = (edges > 0u) ? 0u : h->still_ticks + 1u;
  if (bad > 0u) {
    h->suspicion = clamp_u32(h->suspicion + bad * SUSPICION_STEP, 0, 2u * SUSPICION_LIMIT);
  } else if (h->suspicion > 0u) {
    h->suspicion -= clamp_u32(edges, 0, h->suspicion);
  }
  if (h->suspicion >= SUSPICION_LIMIT || h->invalid_ticks >= INVALID_TICKS || h->wrong) {
    h->faulty = true;
  } else if (h->suspicion == 0u && h->invalid_ticks == 0u) {
    h->faulty = false;
  }
}

static void conclude_proof(hall_t *h, hall_verdict_t verdict) {
  h->proven = verdict == HALL_RIGHT;
  h->wrong = verdict == HALL_WRONG;
}

COLD hall_verdict_t hall_prove_coasting(hall_t *h, const chip_snapshot_t *in, bool reverse, uint32_t emf_turn_q32,
                                        int32_t step_q32) {
  const bool backward = step_q32 < 0;
  const int32_t ahead_q16 = hall_ahead_q16(emf_turn_q32, backward, position_of(in->hall.sector, reverse));
  hall_verdict_t verdict =
      hall_proof_step(&h->proof, ahead_q16, h->new_edges, (uint32_t)abs_sat(step_q32) >> 16, EDGES_COASTING);
  if (h->proof.edges > 0u && h->backward != backward) {
    verdict = HALL_WRONG;
  }
  conclude_proof(h, verdict);
  return verdict;
}

// While the crossings commutate: the sector that they drive against that of the sensors. With a sector a tick the looks would
// all fall on the same place in it.
COLD static void prove_crossed(hall_t *h, const six_step_view_t *view, int32_t advance_q16, bool reverse) {
  const chip_snapshot_t *in = view->in;
  const uint32_t crossings = view->m->crossings - h->crossings;
  h->crossings = view->m->crossings;
  if (view->m->sector_cycles * 9u < (uint32_t)view->p->tick_cycles * 10u || h->suspicion > 0u) {
    return;
  }
  if (h->proof.looks > LOOKS_MAX) {
    hall_proof_begin(&h->proof);
  }
  const int32_t sectors = sectors_from(in->hall.sector, in->hall.driven);
  const int32_t ahead_q16 = ((reverse ? -sectors : sectors) * TURN_Q16 - advance_q16) / (int32_t)SECTORS;
  const uint32_t travel_q16 = clamp_u32(crossings, 0, SECTORS) * (TURN_Q16 / SECTORS);
  conclude_proof(h, hall_proof_step(&h->proof, ahead_q16, h->new_edges, travel_q16, EDGES_CROSSED));
}

bool hall_wants_proof(const hall_t *h, const six_step_view_t *view) {
  const int32_t seen_v_q25 = (view->p->catch_v_q17 + (view->p->catch_v_q17 >> SEEN_SHIFT)) * 256;
  return h->driving && !h->proven && h->trials < TRIALS_MAX && view->m->emf_v_q25 > seen_v_q25;
}

void hall_pull(hall_t *h) {
  h->net = 0;
  h->contrary = 0;
}

COLD bool hall_pulls_wrong(hall_t *h, int32_t driven_v_q25, int32_t drop_v_q25, int32_t emf_v_q25) {
  const bool stays = h->net > -TURN_EDGES && h->net < TURN_EDGES;
  // A load that turns the rotor backward adds its EMF to the voltage, and the current is beyond what the voltage alone drives.
  const bool powered = h->net <= -TURN_EDGES && emf_v_q25 > driven_v_q25 / 2 && drop_v_q25 < driven_v_q25;
  h->wrong = h->wrong || (stays && h->contrary >= SWINGS) || powered;
  return h->wrong;
}

bool hall_probe(hall_t *h, const parameters_t *p, uint32_t ticks) {
  const int32_t patience_ticks = greater(p->hall_stall_ticks, p->hall_start_ticks / PATIENCE_SHARE);
  if (h->probing || clamp_u32(h->still_ticks, 0, ticks) <= (uint32_t)patience_ticks) {
    return false;
  }
  h->probing = true;
  h->probe_from = h->edge_count;
  __builtin_memset(h->aligned, 0, sizeof h->aligned);
  return true;
}

// The rotor swings about the place at which the alignment holds it.
COLD void hall_look_aligned(hall_t *h, const six_step_view_t *view, bool reverse, bool second) {
  const uint32_t place = second ? ALIGNED_SECOND : ALIGNED_FIRST;
  const int32_t off = sectors_from(place, position_of(view->in->hall.sector, reverse));
  aligned_t *aligned = &h->aligned[second ? 1 : 0];
  aligned->looks++;
  aligned->off += (off != 0) ? 1u : 0u;
  aligned->far += (abs_sat(off) > 1) ? 1u : 0u;
}

// Friction and a load may leave the rotor a sector off, for half of the time or at one of the two places. One that does not
// follow is blocked.
COLD bool hall_aligns_wrong(hall_t *h) {
  bool off = true;
  bool far = false;
  for (uint32_t k = 0; k < 2u; k++) {
    off = off && h->aligned[k].off * 4u >= h->aligned[k].looks * 3u;
    far = far || h->aligned[k].far * 4u > h->aligned[k].looks;
  }
  const bool followed = h->edge_count - h->probe_from >= 2u;
  h->wrong = h->wrong || (followed && (off || far));
  return h->wrong;
}

bool hall_is_doubtful(const hall_t *h) {
  return h->driving && (h->suspicion > 0u || (!h->proven && h->contrary >= SWINGS / 2u));
}

bool hall_disappoints(const hall_t *h, const parameters_t *p) {
  return h->driving && (h->faulty || h->net <= -TURN_EDGES || hall_rotor_stalled(h, p));
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

// A start that was asked for tries again what was found wrong before.
COLD void hall_forget(hall_t *h) {
  h->driving = false;
  h->faulty = h->faulty && !h->wrong;
  h->wrong = false;
  h->refused = false;
  h->trials = 0;
}

COLD void hall_coast(hall_t *h) {
  h->probing = false;
  hall_proof_begin(&h->proof);
}

COLD void hall_await_proof(hall_t *h) {
  h->trials++;
  hall_coast(h);
}

bool hall_backs_up(const hall_t *h, const parameters_t *p) {
  return h->driving || (p->hall_mode == HALL_FALLBACK && !h->faulty && h->proven);
}

bool hall_blames_crossings(const hall_t *h, const parameters_t *p) {
  return hall_backs_up(h, p) && p->hall_mode == HALL_FALLBACK && !h->faulty && (h->driving ? h->driving_ticks < AFTERMATH_TICKS : h->apart);
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
COLD static void compare(hall_t *h, const six_step_view_t *view, bool reverse) {
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
COLD static hall_advice_t hand_over(hall_t *h, const six_step_view_t *view, bool reverse) {
  compare(h, view, reverse);
  if (h->driving) {
    h->driving_ticks++;
    return (h->agreeing >= AGREEING_EDGES && h->driving_ticks > DRIVING_TICKS) ? give_back(h) : HALL_KEEP;
  }
  const bool lost = view->in->misses >= MISSES_LOST || (h->apart && h->learnt[reverse ? 1 : 0]);
  return (!h->faulty && h->proven && lost) ? take_over(h) : HALL_KEEP;
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

HOT hall_advice_t hall_step(hall_t *h, edge_command_t *command, const six_step_view_t *view, bool reverse,
                            int32_t advance_q16) {
  const hall_advice_t advice =
      (view->p->hall_mode == HALL_FALLBACK) ? hand_over(h, view, reverse) : HALL_KEEP;
  command->read = false;
  if (!h->proven && !h->driving && !h->wrong) {
    prove_crossed(h, view, advance_q16, reverse);
  }
  if (advice == HALL_KEEP && !h->driving && !h->refused && (h->faulty || h->wrong)) {
    h->refused = true;
    return HALL_REFUSE;
  }
  if (h->wrong || !view->settings->hall_learn || view->settings->freeze) {
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
