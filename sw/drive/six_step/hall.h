// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Hall sensors: judged at every tick, learnt once a turn, and when they drive.
//
//   sensored   the edges commutate from the start on
//   fallback   the crossings commutate; when they are lost (missed, or apart from the edges) the edges take over, until
//              the crossings agree with them again
//
// Sensors whose codes are invalid or skip sectors are faulty: they take nothing over, and driving they are a fault.
#ifndef FL_DRIVE_HALL_H
#define FL_DRIVE_HALL_H

#include "control/balance.h"
#include "drive/six_step/view.h"

// Hall sensors. late: how late the edge into each sector comes, for positive [0] and negative [1] speed.
typedef struct {
  bool driving;  // the edges commutate, or will from the start on
  bool faulty;
  bool backward;
  bool learnt[2];
  bool seen;   // the counters below are of the last tick
  bool apart;  // the last edge lay far from where the crossing before it puts it
  uint16_t edges;
  uint8_t invalid;
  uint8_t skipped;
  uint32_t edge_count;     // since boot
  uint32_t still_ticks;    // without an edge
  uint32_t invalid_ticks;  // consecutive, with an invalid code
  uint32_t suspicion;      // rises with invalid codes and skipped sectors, falls with good edges
  uint32_t agreeing;       // edges in a row that crossings agree with
  uint32_t driving_ticks;  // since the edges took over
  uint32_t handovers;      // from crossings to edges, since boot
  uint32_t judged_edges;   // edge_count that was compared with a crossing
  uint32_t stage;
  uint32_t turn_from;      // edge_count when the wait for a turn began
  uint32_t period_cycles;  // of the turn before
  int32_t late_x6[SECTORS];
  int32_t target_q16[SECTORS];
  int32_t late_q20[2][SECTORS];
} hall_t;

// Who is to commutate from now on.
typedef enum { HALL_KEEP, HALL_TAKE_OVER, HALL_GIVE_BACK } hall_advice_t;

// Offsets of the parameters, nothing learnt.
void hall_init(hall_t *h, const parameters_t *p);

// Judge codes and edges of the last tick. Every tick, before supervision; about 100 clocks.
void hall_judge(hall_t *h, const chip_snapshot_t *in);

// What commutates in the start that begins, and its offsets for the direction. Before it: after hall_resort, for a start
// that follows a lost lock or a failed one, the edges where they can; after hall_forget, for one that was asked for, the
// edges of a sensored drive only.
void hall_begin(hall_t *h, edge_command_t *command, const parameters_t *p, bool reverse);
void hall_resort(hall_t *h, const parameters_t *p);
void hall_forget(hall_t *h);

// While running: hand over between crossings and edges, then one stage of the learning. At most 300 clocks.
hall_advice_t hall_step(hall_t *h, edge_command_t *command, const six_step_view_t *view, bool reverse);

// The sensors drive or may take over: lost crossings end nothing.
bool hall_backs_up(const hall_t *h, const parameters_t *p);

// The edges say that the crossings were wrong just now: what follows from it is a lost lock.
bool hall_blames_crossings(const hall_t *h, const parameters_t *p);

// Edges have been away for so long that the rotor stands: for the precharge, or for a drive that runs.
bool hall_rotor_slow(const hall_t *h, const parameters_t *p);
bool hall_rotor_stalled(const hall_t *h, const parameters_t *p);

// An interval of the edges that are coming now, in the direction that is set; 0: none yet. from_edges: of the drive's
// count when it began to drive.
uint32_t hall_interval_cycles(const hall_t *h, const six_step_view_t *view, bool reverse, uint32_t from_edges);

#endif
