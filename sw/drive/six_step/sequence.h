// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// What commutates: sequencer, crossing detector and commutation timer. The only writer of their command section.
#ifndef FL_SEQUENCE_H
#define FL_SEQUENCE_H

#include "drive/settings.h"
#include "hal/chip_io.h"

void sequence_init(sequence_command_t *c, const settings_t *settings);

// Gates, detector and timer off.
void sequence_off(sequence_command_t *c);

// The legs by hand: `special` gets `command`, the others `others`.
void sequence_legs(sequence_command_t *c, leg_command_t others, uint32_t special, leg_command_t command);

// The sequencer from this sector on, crossings are searched for.
void sequence_run(sequence_command_t *c, uint32_t start_sector);

// The direction.
void sequence_direct(sequence_command_t *c, bool reverse);

// Who commutates: nobody, the clock at these intervals, crossings or edges.
void sequence_time(sequence_command_t *c, commutation_mode_t timer);
void sequence_force(sequence_command_t *c, uint32_t interval_cycles);

// Missed crossings: after `miss_limit` of them the hardware reports a lost lock, 0: it does not; forced: it commutates
// after the timeout all the same.
void sequence_miss(sequence_command_t *c, uint32_t miss_limit);
void sequence_force_on_miss(sequence_command_t *c, bool forced);

void sequence_sample(sequence_command_t *c, uint32_t sampling);
void sequence_pattern(sequence_command_t *c, const settings_t *settings);
// How a commutation meets the carrier: COMMUTATION_RSC...
void sequence_align(sequence_command_t *c, uint32_t commutation);
void sequence_rectify(sequence_command_t *c, bool sync_rect);

// How crossings are found. True: in another signal than before.
bool sequence_cross(sequence_command_t *c, const settings_t *settings);
// A rotor that leads the forced field by more than the flank's 30 degrees would be computed back to a wrong angle; the
// crossings have to catch up with it first.
void sequence_never_back(sequence_command_t *c);

// Write it all at the next tick.
void sequence_refresh(sequence_command_t *c);

#endif
