// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// The chip as a whole: what it is, its configuration, and snapshot and command of a six-step tick. The other sources of
// this folder drive a peripheral each.
#include "hal/chip.h"

#include "control/placement.h"
#include "hal/blocks.h"
#include "hal/reg.h"

bool chip_is_known(void) {
  const uint32_t build = reg_read(REG(sys.build));
  return reg_read(REG(sys.id)) == FL_SYS_REGS__ID__MAGIC_reset &&
         BITS(FL_SYS_REGS__BUILD__MAP_VERSION, build) == FL_SYS_REGS__BUILD__MAP_VERSION_reset &&
         BITS(FL_SYS_REGS__BUILD__PHASES, build) == PHASES;
}

bool chip_fits(const parameters_t *p) {
  uint32_t used = BLOCK_OF(foc.control);
  if (method_is_six_step(p->method)) {
    used = BLOCK_OF(zcd.blanking) | BLOCK_OF(comm.latency) | BLOCK_OF(pwm.min_pulse);
    used |= (p->hall_mode != 0) ? BLOCK_OF(hall.filter) : 0u;
  } else {
    used |= (p->encoder_quarters > 1) ? BLOCK_OF(encoder.filter) : 0u;
    used |= (p->injection != 0) ? BLOCK_OF(injection.control) : 0u;
  }
  return (reg_read(REG(sys.blocks)) & used) == used && safety_polarity() == (uint32_t)p->gate_polarity;
}

uint32_t chip_clock_hz(void) { return reg_read(REG(sys.clock)); }
HOT uint32_t chip_now(void) { return reg_read(REG(sys.time_now)); }

SMALL_CODE_BEGIN
COLD void chip_configure(const parameters_t *parameters) {
  safety_configure(parameters);
  sense_configure(parameters);
  zcd_configure(parameters);
  comm_configure(parameters);
  freewheel_configure(parameters);
  hall_configure(parameters);
  pwm_configure(parameters);
  if (method_is_vector(parameters->method)) {
    foc_configure(parameters);
    if (parameters->injection != 0 && (HELD & HELD_INJECTION) != 0) {
      chip_configure_injection(parameters);
    }
  }
}
SMALL_CODE_END

HOT void chip_read(chip_snapshot_t *snapshot, bool voltages) {
  sense_read_sums(snapshot);
  sense_read_currents(snapshot);
  if (voltages) {
    sense_read_voltages(snapshot);
  }
  comm_read_crossings(snapshot);
  zcd_read_late(snapshot);
  comm_read_events(snapshot);
  safety_read_trips(snapshot);
}

// What stays as it is while the drive runs.
COLD static void write_sequence(const sequence_command_t *command, const parameters_t *p) {
  sense_schedule(command->sampling, (uint32_t)p->sample_offset_cycles);
  pwm_write_sequence(command);
  zcd_write_sequence(command, p);
  comm_write_sequence(command);
}

// What the control loop moves.
HOT static void write_loop(const loop_command_t *command, uint8_t source) {
  pwm_write_loop(command);
  comm_write_loop(command);
  zcd_write_loop(command, source);
}

HOT void chip_write(six_step_command_t *command, const parameters_t *parameters) {
  if (command->sequence.fresh) {
    write_sequence(&command->sequence, parameters);
    command->sequence.fresh = false;
  }
  write_loop(&command->loop, command->sequence.crossing.zcd_source);
  if (command->threshold.fresh) {
    zcd_write_thresholds(&command->threshold);
    command->threshold.fresh = false;
  }
  if (command->edge.fresh) {
    comm_write_edges(&command->edge);
    command->edge.fresh = false;
  }
  timer_commit();
}
