// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Program of its own for the chip: commutations at a set interval, means of the output by a table. The duty goes the way
// that it goes in the drive: mean, correction for the cut pulse, pulse width, registers. No crossing, no regulator.
#include "control/carrier.h"
#include "control/csc_linearity.h"
#include "drive/parameters.h"
#include "hal/chip.h"
#include "hal/cpu.h"
#include "hal/soc/trap.h"

typedef struct {
  uint32_t interval_cycles;  // from commutation to commutation
  uint32_t period_cycles;    // of the carrier
  int32_t mean_q30;          // wanted mean of the output
  uint32_t compensate;       // 1: duty by (5.18), 0: duty = mean
  uint32_t hold_cycles;      // time until the next row
} row_t;

typedef struct {
  uint32_t count;
  row_t row[];
} table_t;

// Nothing interrupts: no source is enabled.
void trap_current(void) {}
void trap_control(void) {}
void trap_deferred(void) {}

static uint32_t pulse_of(const row_t *row) {
  int32_t duty_q30 = row->mean_q30;
  if (row->compensate != 0u) {
    const csc_linearity_t linearity =
        csc_linearity(row->interval_cycles, row->period_cycles, CSC_TOLERANCE_Q16);
    duty_q30 = csc_linear_duty_q30(&linearity, duty_q30);
  }
  return pulse_cycles_q8(duty_q30, row->period_cycles, 0);
}

int main(void) {
  static parameters_t parameters;
  parameters = ((const parameter_block_t *)cpu_parameter_block())->parameters;
  parameters.watchdog_cycles = 0;  // no step reports here
  const parameters_t *p = &parameters;
  const table_t *table = (const table_t *)RAM_TABLE;
  chip_gates_off();
  chip_configure(p);
  chip_irq_configure(0, 0);
  chip_set_tick((uint32_t)p->tick_cycles);
  guard_command_t guard = {.enable = true};
  six_step_command_t command = {
      .sequence =
          {
              .sequencer = SEQUENCER_SIX_STEP,
              .timer = COMMUTATION_FORCED,
              .commutation = (uint32_t)p->commutation,
              .pattern = (uint32_t)p->pattern,
              .sampling = SAMPLING_CONTINUOUS,
          },
      .loop = {.timeout_q12 = COMMUTATION_TIMEOUT_Q12},
  };
  chip_write_guard(&guard);
  for (uint32_t i = 0; i < table->count; i++) {
    const row_t *row = &table->row[i];
    const uint32_t start = chip_now();
    command.sequence.forced_interval_cycles = row->interval_cycles;
    command.sequence.fresh = true;
    command.loop.period_cycles = row->period_cycles;
    command.loop.pulse_cycles_q8 = pulse_of(row);
    chip_write(&command, p);
    while (chip_now() - start < row->hold_cycles) {
    }
  }
  chip_gates_off();
  for (;;) {
  }
}
