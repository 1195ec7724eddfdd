// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "drive/hall.h"

#include "control/fixed.h"
#include "control/hall_offset.h"
#include "control/placement.h"
#include "drive/thresholds.h"

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

static int32_t late_q16(const drive_t *drive, uint32_t sector) {
  return drive->hall.late_q20[drive->reverse ? 1 : 0][sector] / 16;
}

COLD static void write_offsets(drive_t *drive) {
  for (uint32_t s = 0; s < SECTORS; s++) {
    drive->command.hall_offset_q16[s] = -late_q16(drive, s);
  }
  drive->command.write_offsets = true;
}

static void wait_for_turn(drive_t *drive) {
  drive->hall.stage = STAGE_WAIT;
  drive->hall.turn_from = drive->hall.edge_count;
}

COLD void hall_init(drive_t *drive) {
  drive->hall = (hall_t){0};
  for (uint32_t s = 0; s < SECTORS; s++) {
    drive->hall.late_q20[0][s] = drive->p->hall_late_q16[s] * 16;
  }
  hall_mirror(drive->hall.late_q20[0], true, drive->hall.late_q20[1]);
}

HOT void hall_judge(drive_t *drive, const chip_snapshot_t *in) {
  hall_t *h = &drive->hall;
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

COLD void hall_begin(drive_t *drive) {
  hall_t *h = &drive->hall;
  if (drive->p->hall_mode == HALL_OFF) {
    return;
  }
  h->driving = drive->p->hall_mode == HALL_SENSORED || (h->driving && !h->faulty);
  h->apart = false;
  h->agreeing = 0;
  h->driving_ticks = 0;
  wait_for_turn(drive);
  const uint32_t way = drive->reverse ? 1u : 0u;
  if (!h->learnt[way] && h->learnt[1u - way]) {
    hall_mirror(h->late_q20[1u - way], drive->reverse, h->late_q20[way]);
  }
  write_offsets(drive);
}

COLD void hall_resort(drive_t *drive) {
  drive->hall.driving = drive->p->hall_mode != HALL_OFF;
}

bool hall_backs_up(const drive_t *drive) {
  return drive->hall.driving || (drive->p->hall_mode == HALL_FALLBACK && !drive->hall.faulty);
}

bool hall_blames_crossings(const drive_t *drive) {
  const hall_t *h = &drive->hall;
  return drive->p->hall_mode == HALL_FALLBACK && !h->faulty &&
         (h->driving ? h->driving_ticks < AFTERMATH_TICKS : h->apart);
}

bool hall_rotor_slow(const drive_t *drive) { return drive->hall.still_ticks > (uint32_t)drive->p->hall_calm_ticks; }

bool hall_rotor_stalled(const drive_t *drive) {
  return drive->hall.driving && drive->hall.still_ticks > (uint32_t)drive->p->hall_stall_ticks;
}

uint32_t hall_interval_cycles(const drive_t *drive, const chip_snapshot_t *in, uint32_t from_edges) {
  const hall_t *h = &drive->hall;
  if (h->edge_count - from_edges < 3u || h->backward != drive->reverse) {
    return 0;
  }
  const uint32_t still_cycles = clamp_u32(h->still_ticks, 0, 0xFFFu) * (uint32_t)drive->p->tick_cycles;
  return clamp_u32(in->zc_interval_cycles, still_cycles, 0xFFFFFFu);
}

const char *hall_state_name(const drive_t *drive) {
  if (drive->p->hall_mode == HALL_OFF) {
    return "off";
  }
  return drive->hall.faulty ? "faulty" : "ok";
}

COLD static void take_over(drive_t *drive) {
  drive->hall.driving = true;
  drive->hall.driving_ticks = 0;
  drive->hall.agreeing = 0;
  drive->hall.handovers++;
  drive->lost_locks++;
  thresholds_reset(drive);
  drive->command.timer = COMMUTATION_HALL;
  drive->command.write_modes = true;
}

COLD static void give_back(drive_t *drive) {
  drive->hall.driving = false;
  drive->hall.apart = false;
  drive->command.timer = COMMUTATION_ZCD;
  drive->command.write_modes = true;
}

// The last edge against the crossing before it. Where the codes raise suspicion it is the edge that is wrong.
HOT static void compare(drive_t *drive, const chip_snapshot_t *in) {
  hall_t *h = &drive->hall;
  if (h->edge_count == h->judged_edges || drive->m.sector_cycles == 0u) {
    return;
  }
  h->judged_edges = h->edge_count;
  if (h->suspicion > 0u) {
    h->agreeing = 0;
    h->apart = false;
    return;
  }
  const int32_t late = hall_late_from_phase_q16(in->hall.phase_cycles, 6u * drive->m.sector_cycles);
  const int32_t distance = abs_sat(late - late_q16(drive, in->hall.sector));
  h->agreeing = (distance < AGREEING_Q16) ? h->agreeing + 1u : 0u;
  h->apart = distance >= APART_Q16;
}

// Fallback: who commutates.
HOT static void hand_over(drive_t *drive, const chip_snapshot_t *in) {
  hall_t *h = &drive->hall;
  compare(drive, in);
  if (h->driving) {
    h->driving_ticks++;
    if (h->agreeing >= AGREEING_EDGES && h->driving_ticks > DRIVING_TICKS) {
      give_back(drive);
    }
  } else if (!h->faulty) {
    if (in->misses >= MISSES_LOST || (h->apart && h->learnt[drive->reverse ? 1 : 0])) {
      take_over(drive);
    }
  }
  // Without sensors to take over, the hardware stops a drive that has lost its lock.
  const uint32_t miss_limit = hall_backs_up(drive) ? 0u : (uint32_t)drive->p->miss_limit;
  if (miss_limit != drive->command.miss_limit) {
    drive->command.miss_limit = miss_limit;
    drive->command.write_modes = true;
  }
}

// Lateness by the intervals of the edges, where they are what is measured.
COLD static bool take(drive_t *drive, const chip_snapshot_t *in) {
  hall_t *h = &drive->hall;
  const uint32_t period = in->zc_period_cycles;
  const uint32_t change = (period > h->period_cycles) ? period - h->period_cycles : h->period_cycles - period;
  h->period_cycles = period;
  interval_lateness(in->sector_interval_cycles, drive->reverse, h->late_x6);
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
COLD static bool conclude(drive_t *drive) {
  hall_t *h = &drive->hall;
  const int32_t *known = h->late_q20[drive->reverse ? 1 : 0];
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

COLD static void learn(drive_t *drive) {
  hall_t *h = &drive->hall;
  const uint32_t way = drive->reverse ? 1u : 0u;
  for (uint32_t s = 0; s < SECTORS; s++) {
    int32_t *late = &h->late_q20[way][s];
    const int32_t error = h->target_q16[s] * 16 - *late;
    *late = clamp_i32(*late + (h->learnt[way] ? error / (1 << LEARN_SHIFT) : error), -LATE_MAX_Q20, LATE_MAX_Q20);
  }
  h->learnt[way] = true;
  write_offsets(drive);
}

COLD static void learn_stage(drive_t *drive, const chip_snapshot_t *in) {
  hall_t *h = &drive->hall;
  switch (h->stage) {
    case STAGE_TAKE:
      h->stage = STAGE_SECTOR;
      if (!take(drive, in)) {
        wait_for_turn(drive);
      }
      break;
    case STAGE_DONE:
      if (conclude(drive)) {
        learn(drive);
      }
      wait_for_turn(drive);
      break;
    default:
      compare_sector(h, h->stage - STAGE_SECTOR);
      h->stage++;
      break;
  }
}

HOT void hall_step(drive_t *drive, const chip_snapshot_t *in) {
  hall_t *h = &drive->hall;
  if (drive->p->hall_mode == HALL_FALLBACK) {
    hand_over(drive, in);
  }
  if (!drive->settings.hall_learn || drive->settings.freeze) {
    return;
  }
  if (h->stage != STAGE_WAIT) {
    learn_stage(drive, in);
  } else if (h->edge_count - h->turn_from > EDGES_A_TURN) {
    drive->command.read_phases = true;
    h->stage = STAGE_TAKE;
  }
}
