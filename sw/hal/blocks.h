// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// What the drivers of the peripherals do for each other and for chip.c; all others call chip.h. A source of this folder
// drives each peripheral of the register map and has its name, but for flash.c (spi) and chip.c (sys).
#ifndef FL_BLOCKS_H
#define FL_BLOCKS_H

#include <stdbool.h>
#include <stdint.h>

#include "hal/chip_io.h"
#include "params.h"

// From the crossing to the commutation, over the interval, before advance.
#define COMMUTATION_DELAY_Q16 0x8000

// At boot; gates stay off.
void safety_configure(const parameters_t *p);
void sense_configure(const parameters_t *p);
void zcd_configure(const parameters_t *p);
void comm_configure(const parameters_t *p);
void freewheel_configure(const parameters_t *p);
void hall_configure(const parameters_t *p);
void pwm_configure(const parameters_t *p);
void encoder_configure(const parameters_t *p);
void foc_configure(const parameters_t *p);

// Bit 0, 1: the pins of the upper, of the lower gates are active low.
uint32_t safety_polarity(void);
// The sector that is driven now.
uint32_t pwm_sector(void);

// Parts of a tick's snapshot.
void sense_read_sums(chip_snapshot_t *snapshot);
void sense_read_voltages(chip_snapshot_t *snapshot);
void sense_read_currents(chip_snapshot_t *snapshot);
void comm_read_crossings(chip_snapshot_t *snapshot);
void comm_read_events(chip_snapshot_t *snapshot);
void zcd_read_late(chip_snapshot_t *snapshot);
void safety_read_trips(chip_snapshot_t *snapshot);
void encoder_read_counters(chip_vector_snapshot_t *v);
// The set that was committed before took effect at this tick.
bool timer_has_taken(void);

// Parts of its command.
void sense_schedule(uint32_t sampling, uint32_t offset_cycles);
void sense_start_auto_zero(void);
void pwm_write_sequence(const sequence_command_t *command);
void zcd_write_sequence(const sequence_command_t *command, const parameters_t *p);
void comm_write_sequence(const sequence_command_t *command);
void pwm_write_loop(const loop_command_t *command);
void comm_write_loop(const loop_command_t *command);
void zcd_write_loop(const loop_command_t *command, uint8_t source);
void zcd_write_thresholds(const threshold_command_t *command);
void comm_write_edges(const edge_command_t *command);
// The next tick comes after so many samples; 0: by time.
void timer_tick_by_samples(uint32_t samples);
// All that was written takes effect at the next tick.
void timer_commit(void);

#endif
