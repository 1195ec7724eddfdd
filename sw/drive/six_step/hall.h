// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Hall sensors: judged at every tick, learnt once a turn, and when they drive.
//
//   sensored   the edges commutate from the start on
//   fallback   the crossings commutate; when they are lost (missed, or apart from the edges) the edges take over, until
//              the crossings agree with them again
//
// Sensors whose codes are invalid or skip sectors are faulty: they take nothing over, and driving they are a fault.
//
// Codes that look right may come from exchanged or inverted wires, or from sensors far off. So the sensors are proven once
// against the machine: while the gates are open against the angle of its EMF, and while the crossings commutate against the
// sector that these drive. Edges that commutate before are proven as soon as the rotor is fast enough: the drive lets it
// coast for two sectors. At a start from rest three things tell wrong ones: a rotor that swings about one edge, one
// that turns backward although it takes power, and one that stays without an edge but follows an alignment.
#ifndef FL_DRIVE_HALL_H
#define FL_DRIVE_HALL_H

#include "control/balance.h"
#include "control/hall_proof.h"
#include "drive/six_step/view.h"

// Looks at a rotor that an alignment holds: how many of them show another sector, and how many one that is no neighbour.
typedef struct {
  uint32_t looks;
  uint32_t off;
  uint32_t far;
} aligned_t;

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
  hall_proof_t proof;
  bool proven;     // by the machine: right
  bool wrong;      // by the machine: wires or places are wrong
  bool refused;    // and the log says so
  bool probing;    // the start aligns the rotor to see where the sensors show it
  uint32_t trials; // times that the drive has let the rotor coast for a proof
  uint32_t new_edges;  // of the last tick
  uint8_t sector;      // of the last tick, to drive for the direction
  int32_t net;         // sectors that the edges led in the drive's direction since it began to pull, a turn at most
  uint32_t contrary;   // edges against the drive's direction since then
  uint32_t crossings;  // of the last look at the sector that they drive
  uint32_t probe_from; // edge_count when the probing began
  aligned_t aligned[2];
  int32_t late_x6[SECTORS];
  int32_t target_q16[SECTORS];
  int32_t late_q20[2][SECTORS];
} hall_t;

// Who is to commutate from now on. HALL_REFUSE: the crossings; the sensors are faulty, once.
typedef enum { HALL_KEEP, HALL_TAKE_OVER, HALL_GIVE_BACK, HALL_REFUSE } hall_advice_t;

// Offsets of the parameters, nothing learnt.
void hall_init(hall_t *h, const parameters_t *p);

// Judge codes and edges of the last tick. Every tick, before supervision; about 130 clocks.
void hall_judge(hall_t *h, const chip_snapshot_t *in, bool reverse);

// What commutates in the start that begins, and its offsets for the direction. Before it: after hall_resort, for a start
// that follows a lost lock or a failed one, the edges where they can; after hall_forget, for one that was asked for, the
// edges of a sensored drive only.
void hall_begin(hall_t *h, edge_command_t *command, const parameters_t *p, bool reverse);
void hall_resort(hall_t *h, const parameters_t *p);
void hall_forget(hall_t *h);

// While running: hand over between crossings and edges, then one stage of the learning. At most 300 clocks.
hall_advice_t hall_step(hall_t *h, edge_command_t *command, const six_step_view_t *view, bool reverse,
                        int32_t advance_q16);

// Proof while the gates are open. emf_turn_q32, step_q32: argument of the EMF now, and how it turns in a tick.
hall_verdict_t hall_prove_coasting(hall_t *h, const chip_snapshot_t *in, bool reverse, uint32_t emf_turn_q32,
                                   int32_t step_q32);

// The edges commutate, nothing has proven them yet, and the rotor is fast enough for its EMF to do so: let it coast.
bool hall_wants_proof(const hall_t *h, const six_step_view_t *view);

// The rotor begins to coast, at a start or for such a proof.
void hall_coast(hall_t *h);
void hall_await_proof(hall_t *h);

// The drive begins to pull.
void hall_pull(hall_t *h);
// What the pull of a rotor at rest shows: sensors that are wrong. driven_v_q25: voltage of the conducting pair, of which
// drop_v_q25 falls at its resistance.
bool hall_pulls_wrong(hall_t *h, int32_t driven_v_q25, int32_t drop_v_q25, int32_t emf_v_q25);
// Edges stay away from a pull that began `ticks` ago: the start shall align the rotor, once.
bool hall_probe(hall_t *h, const parameters_t *p, uint32_t ticks);
// A look at the second half of either alignment, and after both: the rotor has followed, and the sensors show another place.
void hall_look_aligned(hall_t *h, const six_step_view_t *view, bool reverse, bool second);
bool hall_aligns_wrong(hall_t *h);

// Edges that commutate have given wrong codes, or led back before anything has proven them.
bool hall_is_doubtful(const hall_t *h);

// Edges that commutate are faulty, have led a turn against the drive's direction, or stay away.
bool hall_disappoints(const hall_t *h, const parameters_t *p);

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
