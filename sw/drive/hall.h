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

#include "drive/drive.h"

// Offsets of the parameters, nothing learnt.
void hall_init(drive_t *drive);

// Judge codes and edges of the last tick. Every tick, before supervision; about 100 clocks.
void hall_judge(drive_t *drive, const chip_snapshot_t *in);

// What commutates in the start that begins, and its offsets for the direction. After hall_resort, by a lost lock or a
// failed start, the edges where they can.
void hall_begin(drive_t *drive);
void hall_resort(drive_t *drive);

// While running: hand over between crossings and edges, then one stage of the learning. At most 300 clocks.
void hall_step(drive_t *drive, const chip_snapshot_t *in);

// The sensors drive or may take over: lost crossings end nothing.
bool hall_backs_up(const drive_t *drive);

// The edges say that the crossings were wrong just now: what follows from it is a lost lock.
bool hall_blames_crossings(const drive_t *drive);

// Edges have been away for so long that the rotor stands: for the precharge, or for a drive that runs.
bool hall_rotor_slow(const drive_t *drive);
bool hall_rotor_stalled(const drive_t *drive);

// An interval of the edges that are coming now, in the direction that is set; 0: none yet. from_edges: of the drive's
// count when it began to drive.
uint32_t hall_interval_cycles(const drive_t *drive, const chip_snapshot_t *in, uint32_t from_edges);

// Name of what the sensors are.
const char *hall_state_name(const drive_t *drive);

#endif
