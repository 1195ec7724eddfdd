// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Program of its own for the chip: the current regulators of the hardware on a rotor whose angle and speed are known,
// references of the current by a table, one a sample. Coefficients are designed here, as in the drive. Currents and
// regulator states of the table's samples are sent at the end, a line each: i_d, i_q (3 digits of 6 bits), u_d, u_q (5).
//
// The reference of a row takes effect at the tick that follows the row's sample: the regulators use it at the next one.
#include "control/regulator_design.h"
#include "control/vector_model.h"
#include "drive/parameters.h"
#include "hal/chip.h"
#include "hal/cpu.h"
#include "hal/reg.h"
#include "hal/soc/trap.h"
#include "hal/uart.h"

#define SAMPLES_MAX 512u
#define UART_BIT_CYCLES 50u
#define CURRENT_DIGITS 3u
#define VOLTAGE_DIGITS 5u

typedef struct {
  uint32_t angle_turn_q32;  // of the rotor at time stamp 0
  int32_t omega_turn_q36;
  complex_t preset_v_q17;  // until the regulators are switched on
  uint32_t limit_v_q17;    // circle
  uint32_t band_i_q17;     // without dead-time compensation
  uint32_t scale;          // of the modulator
  uint32_t scale_shift;
  uint32_t settle;  // samples with the first reference before the table begins
  uint32_t count;
  complex_t reference_i_q17[];
} table_t;

typedef struct {
  complex_t current_i_q17;
  complex_t voltage_v_q25;
} seen_t;

static seen_t seen[SAMPLES_MAX];
static parameters_t parameters;
static uint32_t last_tick;

// Nothing interrupts: no source is enabled.
void trap_current(void) {}
void trap_control(void) {}
void trap_deferred(void) {}

static void await_tick(void) {
  while (chip_tick_time() == last_tick) {
  }
  last_tick = chip_tick_time();
}

// The set takes effect at the next tick.
static void commit(vector_command_t *command) {
  command->fresh |= FRESH_CONTROL | FRESH_REFERENCE;
  chip_write_vector(command, &parameters);
  await_tick();
}

static void design(vector_command_t *command) {
  const vector_machine_t machine = {
      .resistance_q30 = (uint32_t)parameters.vector_resistance_q30,
      .delay_q30 = (uint32_t)parameters.vector_delay_q30,
      .admittance = parameters.vector_admittance,
      .impedance = parameters.vector_impedance,
      .period_cycles = (uint32_t)parameters.vector_sample_cycles,
      .harmonic = 1,
      .park = (parameters.vector_park != 0) ? PARK_EXACT : PARK_HELD,
  };
  vector_plant_t plant;
  vector_model_t model;
  regulator_gains_t gains = {0};
  vector_plant(&plant, &machine);
  vector_model(&model, &plant, command->omega_turn_q36);
  (void)regulator_design(&gains, &parameters.vector_regulator, &plant.machine, &model);
  command->gains.gain[0] = gains.g;
  command->gains.hold[0] = gains.h;
  command->gains.ratio_q17[0] = gains.ratio_q17;
  command->gains.shift[0] = (uint32_t)gains.shift;
  command->limits.lead_q32 = vector_lead_turn_q32(&machine, command->omega_turn_q36);
}

// From the chip's angle to the rotor's, at the last sample.
static int32_t angle_error(const table_t *table, const chip_vector_snapshot_t *in) {
  const uint32_t strobe = reg_read(REG(foc.snap_time)) + (uint32_t)parameters.sense_delay_cycles;
  const uint64_t turned = (uint64_t)((int64_t)table->omega_turn_q36 * (int64_t)strobe) >> 4;
  return (int32_t)(table->angle_turn_q32 + (uint32_t)turned - in->theta_sample_q32);
}

static void send(int32_t value, uint32_t digits) {
  for (uint32_t k = digits; k > 0u; k--) {
    uart_put((uint8_t)('0' + (((uint32_t)value >> (6u * (k - 1u))) & 0x3Fu)));
  }
}

int main(void) {
  const table_t *table = (const table_t *)RAM_TABLE;
  parameters = ((const parameter_block_t *)cpu_parameter_block())->parameters;
  const uint32_t tick_cycles = (uint32_t)parameters.tick_cycles;
  parameters.vector_tick_samples = 1;
  parameters.watchdog_cycles = 0;  // no step reports here
  chip_gates_off();
  chip_configure(&parameters);
  chip_irq_configure(0, 0);
  uart_configure(UART_BIT_CYCLES);
  chip_snapshot_t in;
  guard_command_t guard = {.enable = true};
  vector_command_t command = {.omega_turn_q36 = table->omega_turn_q36};
  vector_command_t *v = &command;
  v->control.preset_v_q17[0] = table->preset_v_q17;
  v->limits.v_q17[0] = table->limit_v_q17;
  v->gains.band_i_q17 = table->band_i_q17;
  v->limits.scale = table->scale;
  v->limits.scale_shift = table->scale_shift;
  v->fresh = FRESH_GAINS | FRESH_LIMITS;
  v->look.slow = true;
  design(v);
  last_tick = chip_tick_time();
  chip_set_tick(tick_cycles);
  await_tick();
  commit(&command);
  // Samples come: from here on a tick a sample.
  await_tick();
  await_tick();
  command.fresh |= FRESH_TICK;
  v->tick.by_samples = true;
  commit(&command);
  await_tick();
  chip_read_vector(&in, &command, &parameters);
  v->correct_q32 = angle_error(table, &in.vector);
  commit(&command);
  v->correct_q32 = 0;
  chip_write_guard(&guard);
  v->control.enable = true;
  commit(&command);
  await_tick();
  v->control.regulate[0] = true;
  const uint32_t count = (table->count < SAMPLES_MAX) ? table->count : SAMPLES_MAX;
  for (uint32_t k = 0; k < table->settle + count; k++) {
    const uint32_t row = (k < table->settle) ? 0u : k - table->settle;
    v->reference.i_q17[0] = table->reference_i_q17[row];
    commit(&command);
    chip_read_vector(&in, &command, &parameters);
    seen[row] = (seen_t){in.vector.i_q17[0], in.vector.u_v_q25[0]};
  }
  chip_gates_off();
  for (uint32_t row = 0; row < count; row++) {
    send(seen[row].current_i_q17.re, CURRENT_DIGITS);
    send(seen[row].current_i_q17.im, CURRENT_DIGITS);
    send(seen[row].voltage_v_q25.re, VOLTAGE_DIGITS);
    send(seen[row].voltage_v_q25.im, VOLTAGE_DIGITS);
    uart_put('\n');
  }
  for (;;) {
  }
}
