// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// The chip's measuring and power blocks: configuration at boot, snapshot and command at every control tick.
#ifndef FL_CHIP_H
#define FL_CHIP_H

#include <stdbool.h>
#include <stdint.h>

#include "hal/chip_io.h"
#include "params.h"

// Interrupt sources, bits of the interrupt controller.
enum {
  IRQ_TICK = 1u << 0,
  IRQ_TRIP = 1u << 1,
  IRQ_MACHINE_TIMER = 1u << 2,
  IRQ_UART_RX = 1u << 3,
  IRQ_UART_TX = 1u << 4,
  IRQ_CAPTURE = 1u << 5,
  IRQ_CROSSING = 1u << 6,
  IRQ_LOAD = 1u << 7,
};

// Register map and build are what this firmware was written for.
bool chip_is_known(void);
// The build has all blocks that the parameters use, and gate pins of their polarity.
bool chip_fits(const parameters_t *parameters);
uint32_t chip_clock_hz(void);

// Free-running clock counter.
uint32_t chip_now(void);
// Its value at the last control tick.
uint32_t chip_tick_time(void);

// Static configuration of sensing, crossing detection, timers and protections; gates stay off.
void chip_configure(const parameters_t *parameters);
// Samples of a vector drive that come so much later after a carrier's start than the parameter block has them, clocks.
void chip_shift_samples(const parameters_t *parameters, uint32_t cycles);
// Settings of the injection, which stays off.
void chip_configure_injection(const parameters_t *parameters);
// Period of the control tick; 0 stops it.
void chip_set_tick(uint32_t cycles);
// Period of the machine timer's interrupt; 0 stops it.
void chip_set_machine_timer(uint32_t cycles);
// With the vector method: the control tick becomes periodic again, at once.
void chip_tick_by_time(void);
// Period of the load generator's interrupt; 0 stops it.
void chip_set_load(uint32_t cycles);

// Read the snapshot of the last tick; voltages: of the terminals too.
void chip_read(chip_snapshot_t *snapshot, bool voltages);
// The same for METHOD_VECTOR, as the command of before asked for it.
void chip_read_vector(chip_snapshot_t *snapshot, const vector_command_t *command, const parameters_t *parameters);
void chip_read_injection(chip_injection_snapshot_t *snapshot);
// The parts of it that are seldom needed: current offsets, intervals of the sectors, phases of the
// Hall edges.
void chip_read_offsets(chip_snapshot_t *snapshot);
void chip_read_sectors(chip_snapshot_t *snapshot);
void chip_read_phases(chip_snapshot_t *snapshot);
// Hall sensors, as they are now.
void chip_read_hall(chip_snapshot_t *snapshot);
// Freewheel measurements since the tick before; left alone if there are none.
void chip_read_freewheel(chip_freewheel_t *freewheel);
// Write the sections that are fresh and commit the set for the next tick.
void chip_write(six_step_command_t *command, const parameters_t *parameters);
void chip_write_vector(vector_command_t *command, const parameters_t *parameters);
void chip_write_injection(const injection_command_t *command, const parameters_t *parameters);
// The regulator step that waits, false if none does, and its voltage before the limit, which acts at once.
bool chip_read_direct(chip_direct_t *direct);
void chip_write_direct(const chip_direct_t *direct, complex_t wanted_v_q25);
// Gate enable, the clearing of trips and the measuring of the offsets, at once. Only where fresh: a trip clears the enable
// by itself.
void chip_write_guard(guard_command_t *command);
// The watchdog hears that the control steps go on: `step` is one more than at the last report.
void chip_report_step(uint32_t step);
// Open all gates at once, without a tick.
void chip_gates_off(void);

// Interrupt controller: sources on the control line (pre-empting) and on the deferred line.
void chip_irq_configure(uint32_t control, uint32_t deferred);
uint32_t chip_irq_pending(void);
void chip_irq_clear(uint32_t sources);

// Events lost to a pending bit still set: of the control tick, and of all sources.
uint32_t chip_tick_overruns(void);
uint32_t chip_all_overruns(void);

// Entry of the hardware's log; channel of the code: a phase's current, 0.., or one of the link's.
enum { TRIP_CHANNEL_IDC = 6, TRIP_CHANNEL_VDC = 7 };
typedef struct {
  bool valid;
  uint32_t causes;
  uint32_t stamp;
  uint32_t channel;
  uint32_t code_lsb;
} trip_record_t;
trip_record_t chip_trip_record(uint32_t index);  // 0: the newest

#endif
