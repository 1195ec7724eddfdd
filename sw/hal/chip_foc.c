// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// The vector path: settings, snapshot and command of a tick, and the regulator step on the core.
#include "control/placement.h"
#include "hal/blocks.h"
#include "hal/chip.h"
#include "hal/reg.h"

// Updates in a row without new voltages that trip.
#define VECTOR_MISS_LIMIT 2u

static uint32_t vector_control(const control_command_t *control, const parameters_t *p) {
  const uint32_t regulate = (control->regulate[0] ? 1u : 0u) | (control->regulate[1] ? 2u : 0u);
  return FIELD(FL_FOC_REGS__CONTROL__SOURCE, method_is_vector(p->method) ? 1 : 0) |
         FIELD(FL_FOC_REGS__CONTROL__ENABLE, control->enable ? 1 : 0) |
         FIELD(FL_FOC_REGS__CONTROL__DOUBLE, p->vector_double) |
         FIELD(FL_FOC_REGS__CONTROL__BYPASS, control->bypass ? 1 : 0) |
         FIELD(FL_FOC_REGS__CONTROL__REGULATE, regulate) |
         FIELD(FL_FOC_REGS__CONTROL__DIRECT, p->vector_direct) |
         FIELD(FL_FOC_REGS__CONTROL__MISS_LIMIT, VECTOR_MISS_LIMIT);
}

SMALL_CODE_BEGIN
// Takes effect at the first tick.
COLD void foc_configure(const parameters_t *p) {
  const control_command_t off = {0};
  const uint32_t updates = (p->vector_double != 0) ? 2u : 1u;
  reg_write(REG(foc.control), vector_control(&off, p));
  reg_write(REG(foc.period), (uint32_t)p->vector_sample_cycles * updates);
  reg_write(REG(foc.window), FIELD(FL_FOC_REGS__WINDOW__FROM_CYCLES, p->vector_from_cycles) |
                                 FIELD(FL_FOC_REGS__WINDOW__LENGTH_CYCLES, p->vector_length_cycles));
  reg_write(REG(foc.delay), (uint32_t)p->sense_delay_cycles);
  reg_write(REG(foc.slope), FIELD(FL_FOC_REGS__SLOPE__MANTISSA, p->vector_slope) |
                                FIELD(FL_FOC_REGS__SLOPE__SHIFT, p->vector_slope_shift));
  reg_write(REG(foc.dead_time), (uint32_t)p->vector_dead_comp_cycles);
  reg_write(REG(foc.min_pulse), (uint32_t)p->min_pulse_cycles);
  reg_write(REG(foc.margin), (uint32_t)p->vector_margin_cycles);
  encoder_configure(p);
  chip_shift_samples(p, 0);
  timer_commit();
}
SMALL_CODE_END

// Both axes of a subspace from an array of registers.
HOT static complex_t read_vector(uint32_t address, uint32_t subspace) {
  const int32_t d = (int32_t)reg_read(address + 8u * subspace);
  return (complex_t){d, (int32_t)reg_read(address + 8u * subspace + 4u)};
}

HOT static void write_vector(uint32_t address, uint32_t subspace, complex_t value) {
  reg_write(address + 8u * subspace, (uint32_t)value.re);
  reg_write(address + 8u * subspace + 4u, (uint32_t)value.im);
}

HOT static void read_slow(chip_snapshot_t *snapshot) {
  sense_read_sums(snapshot);
  sense_read_voltages(snapshot);
}

INLINED void chip_read_vector(chip_snapshot_t *snapshot, const vector_command_t *command, const parameters_t *parameters) {
  chip_vector_snapshot_t *v = &snapshot->vector;
  safety_read_trips(snapshot);
  for (uint32_t s = 0; s < SUBSPACES; s++) {
    v->i_q17[s] = read_vector(REG(foc.snap_i[0]), s);
    v->u_v_q25[s] = read_vector(REG(foc.snap_u[0]), s);
    if (parameters->vector_tick_samples > 1) {
      v->v_q17[s] = read_vector(REG(foc.snap_v[0]), s);
      v->v_sum_q17[s] = read_vector(REG(foc.snap_v_sum[0]), s);
    }
  }
  if (__builtin_expect(command->look.steps, 1)) {
    const uint32_t count = reg_read(REG(foc.snap_count));
    const uint32_t limited = BITS(FL_FOC_REGS__SNAP_COUNT__LIMITED, count);
    v->steps = BITS(FL_FOC_REGS__SNAP_COUNT__STEPS, count);
    v->limited[0] = (limited & 1u) != 0u;
    v->limited[1] = (limited & 2u) != 0u;
  }
  if (command->look.angle) {
    v->theta_sample_q32 = reg_read(REG(foc.snap_theta_sample));
    if (parameters->encoder_quarters > 1) {
      const uint32_t position = reg_read(REG(foc.snap_encoder));
      v->encoder_position = BITS(FL_FOC_REGS__SNAP_ENCODER__POSITION, position);
      v->encoder_indexed = BITS(FL_FOC_REGS__SNAP_ENCODER__INDEXED, position) != 0u;
    }
  }
  v->taken = timer_has_taken();
  if (__builtin_expect(parameters->injection != 0 && (HELD & HELD_INJECTION) != 0, 0)) {
    chip_read_injection(&snapshot->injection);
  }
  if (command->look.slow) {
    v->theta_sample_q32 = reg_read(REG(foc.snap_theta_sample));
    read_slow(snapshot);
    encoder_read_counters(v);
    if (command->look.currents) {
      sense_read_currents(snapshot);
    }
  }
}

HOT bool chip_read_direct(chip_direct_t *direct) {
  const uint32_t run = reg_read(REG(foc.direct_run));
  direct->number = BITS(FL_FOC_REGS__DIRECT_RUN__STEP, run);
  direct->i_q17 = read_vector(REG(foc.direct_i[0]), 0);
  return BITS(FL_FOC_REGS__DIRECT_RUN__WAITING, run) != 0u;
}

HOT void chip_write_direct(const chip_direct_t *direct, complex_t wanted_v_q25) {
  write_vector(REG(foc.direct_v[0]), 0, wanted_v_q25);
  reg_write(REG(foc.direct_go), direct->number);
}

COLD static void write_vector_gains(const vector_command_t *vector) {
  reg_write(REG(foc.band), vector->gains.band_i_q17);
  for (uint32_t s = 0; s < SUBSPACES; s++) {
    write_vector(REG(foc.gain[0]), s, vector->gains.gain[s]);
    write_vector(REG(foc.hold[0]), s, vector->gains.hold[s]);
    write_vector(REG(foc.ratio[0]), s, vector->gains.ratio_q17[s]);
    reg_write(REG(foc.shift[0]) + 4u * s, vector->gains.shift[s]);
  }
}

HOT static void write_limits(const limits_command_t *limits) {
  reg_write(REG(foc.lead), (uint32_t)limits->lead_q32);
  reg_write(REG(foc.scale), FIELD(FL_FOC_REGS__SCALE__MANTISSA, limits->scale) |
                                FIELD(FL_FOC_REGS__SCALE__SHIFT, limits->scale_shift));
  for (uint32_t s = 0; s < SUBSPACES; s++) {
    reg_write(REG(foc.limit[0]) + 4u * s, limits->v_q17[s]);
  }
}

// What changes with design and injection.
COLD static void write_slow(vector_command_t *v, const parameters_t *parameters) {
  if ((v->fresh & FRESH_GAINS) != 0u) {
    write_vector_gains(v);
  }
  if ((v->fresh & FRESH_INJECTION) != 0u) {
    chip_write_injection(&v->injection, parameters);
  }
  v->injection.clear = false;
}

COLD static void write_control(const control_command_t *control, const parameters_t *parameters) {
  reg_write(REG(foc.control), vector_control(control, parameters));
  for (uint32_t s = 0; s < SUBSPACES; s++) {
    write_vector(REG(foc.preset[0]), s, control->preset_v_q17[s]);
  }
}

HOT static void write_fresh(vector_command_t *v, const parameters_t *parameters) {
  const uint32_t fresh = v->fresh;
  if (__builtin_expect((fresh & FRESH_CONTROL) != 0u, 0)) {
    write_control(&v->control, parameters);
  }
  if ((fresh & FRESH_REFERENCE) != 0u) {
    for (uint32_t s = 0; s < SUBSPACES; s++) {
      write_vector(REG(foc.reference[0]), s, v->reference.i_q17[s]);
    }
  }
  if ((fresh & FRESH_LIMITS) != 0u) {
    write_limits(&v->limits);
  }
  if ((fresh & FRESH_FORWARD) != 0u) {
    for (uint32_t s = 0; s < SUBSPACES; s++) {
      write_vector(REG(foc.forward[0]), s, v->forward.v_q17[s]);
    }
  }
  if (__builtin_expect((fresh & (FRESH_GAINS | FRESH_INJECTION)) != 0u, 0)) {
    write_slow(v, parameters);
  }
  if (__builtin_expect((fresh & FRESH_TICK) != 0u, 0)) {
    const int32_t samples = v->tick.by_samples ? parameters->vector_tick_samples : 0;
    timer_tick_by_samples((uint32_t)samples);
  }
  v->fresh = 0;
}

INLINED void chip_write_vector(vector_command_t *v, const parameters_t *parameters) {
  reg_write(REG(foc.omega), (uint32_t)v->omega_turn_q36);
  if (v->correct_q32 != 0) {
    reg_write(REG(foc.correct), (uint32_t)v->correct_q32);
  }
  if (v->fresh != 0u) {
    write_fresh(v, parameters);
  }
  timer_commit();
}
