// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Commissioning: a program of its own for the chip, in place of the drive. A host asks for segments on the console and
// evaluates their sums (sim/fluxlock/commission); nothing about the motor is known here.
//
// A line is a row of commands, a letter with its numbers; it ends with `ok` or `error: TEXT`:
//   o                      gates off
//   v D Q                  voltage, v_q17            w D Q   its alternating part
//   i D Q                  current, i_q17            g G H CROSS SHIFT   gains of its regulator
//   s MANTISSA SHIFT LIMIT modulator's scale, voltage limit v_q17
//   a TURN                 frame ahead by this, 2^-32 turn
//   f SPEED STEP           speed of the frame, 2^-44 turn a clock, and its step a tick
//   t TICKS                gates off after so long without a line, 0: never; refuses segments then, until `o`
//   r TICKS BLOCK          measure: a line `b ...` a block, in the order of block_t
// What a line sets acts together when its end has come.
#include "console/format.h"
#include "console/line.h"
#include "drive/parameters.h"
#include "hal/chip.h"
#include "hal/cpu.h"
#include "hal/soc/trap.h"
#include "hal/uart.h"
#include "images/commission/segment.h"

#define UART_BIT_CYCLES 50u
#define LINE_LENGTH 160u
#define SETTLE_TICKS 20u
#define NUMBERS_MAX 4u

static segment_t segment;
static const parameters_t *p;
static uint32_t boot_ticks;
static uint32_t steps;
static char line_text[LINE_LENGTH];
static line_t line = {.text = line_text, .size = LINE_LENGTH};

// Auto-zero before anything else; then ticks that follow the samples. True: the drive may run.
static bool booted(chip_snapshot_t *in) {
  if (boot_ticks > 2u * SETTLE_TICKS && !in->auto_zero_busy) {
    return true;
  }
  chip_read_offsets(in);
  boot_ticks++;
  segment.guard.start_auto_zero = boot_ticks == SETTLE_TICKS;
  segment.guard.fresh = segment.guard.fresh || segment.guard.start_auto_zero;
  return false;
}

static void control_step(void) {
  static bool by_samples;
  chip_snapshot_t in = {.auto_zero_busy = true};
  vector_command_t *command = &segment.command;
  chip_read_vector(&in, command, p);
  if (!by_samples && booted(&in)) {
    by_samples = true;
    command->fresh |= FRESH_TICK;
    command->tick.by_samples = true;
  }
  segment_step(&segment, &in);
  if (segment.guard.fresh) {
    chip_write_guard(&segment.guard);
  }
  chip_write_vector(command, p);
}

// Never raised: the regulator is the hardware's, refusal().
void trap_current(void) {}

void trap_control(void) {
  const uint32_t pending = chip_irq_pending();
  if ((pending & (uint32_t)IRQ_TRIP) != 0u) {
    chip_irq_clear(IRQ_TRIP);
    chip_tick_by_time();
  }
  if ((pending & (uint32_t)IRQ_TICK) != 0u) {
    chip_irq_clear(IRQ_TICK);
    control_step();
    steps++;
    chip_report_step(steps);
  }
}

void trap_deferred(void) {}

static void put(const char *text) { line_put(&line, text); }

static void put_number(int32_t value) {
  char text[FORMAT_LENGTH];
  format_i32(text, value);
  put(" ");
  put(text);
}

static void put_vector(complex_t value) {
  put_number(value.re);
  put_number(value.im);
}

static void put_block(const block_t *block) {
  put("b");
  put_number((int32_t)block->ticks);
  put_vector(block->i_q17);
  put_vector(block->v_q17);
  put_number((int32_t)block->steps);
  put_number(block->vdc_q21);
  put_vector(block->last_i_q17);
  put_number(block->omega_turn_q36);
  put_number(block->last_turn_q32);
  if (segment.set.alternate_v_q17.re != 0 || segment.set.alternate_v_q17.im != 0) {
    put_vector(block->corner_i_q17);
    put_vector(block->middle_i_q17);
  }
  put("\n");
}

// The segment's blocks as they come, until its end.
static const char *tell(void) {
  for (;;) {
    const uint32_t state = critical_enter();
    const bool ended = segment.left_ticks == 0u;
    const bool waiting = segment.head != segment.tail;
    const uint8_t trip = segment.trip;
    const bool forsaken = segment.forsaken;
    critical_leave(state);
    if (waiting) {
      put_block(&segment.block[segment.tail % BLOCKS]);
      segment.tail++;
    } else if (trip != 0u) {
      return "tripped";
    } else if (forsaken) {
      return "no line for too long; gates off";
    } else if (ended) {
      return segment.lost ? "blocks too short for the console" : 0;
    }
  }
}

// The word at *text, which goes on behind it; 0: there is none.
static char *next_word(char **text) {
  char *at = *text;
  while (*at == ' ') {
    at++;
  }
  char *word = at;
  while (*at != ' ' && *at != '\0') {
    at++;
  }
  if (*at == ' ') {
    *at = '\0';
    at++;
  }
  *text = at;
  return (*word == '\0') ? 0 : word;
}

static uint32_t numbers_of(char command) {
  switch (command) {
    case 'o':
      return 0;
    case 'a':
    case 't':
      return 1;
    case 'g':
      return 4;
    case 's':
      return 3;
    default:
      return 2;
  }
}

static void apply(segment_settings_t *set, char command, const int32_t *n, int32_t *turn_q32) {
  const complex_t vector = {n[0], n[1]};
  switch (command) {
    case 'o':
      set->mode = SEGMENT_OFF;
      break;
    case 'v':
      set->mode = SEGMENT_VOLTAGE;
      set->voltage_v_q17 = vector;
      break;
    case 'w':
      set->alternate_v_q17 = vector;
      break;
    case 'i':
      set->mode = SEGMENT_CURRENT;
      set->reference_i_q17 = vector;
      break;
    case 'g':
      set->gain = vector;
      set->cross_q30 = n[2];
      set->shift = (uint32_t)n[3];
      break;
    case 's':
      set->scale = (uint32_t)n[0];
      set->scale_shift = (uint32_t)n[1];
      set->limit_v_q17 = (uint32_t)n[2];
      break;
    case 'a':
      *turn_q32 = n[0];
      break;
    case 't':
      set->patience_ticks = (uint32_t)n[0];
      break;
    default:
      set->target_turn_q44 = n[0];
      set->step_turn_q44 = n[1];
      break;
  }
}

static bool known(const char *word) {
  static const char commands[] = "ovwigsatfr";
  for (uint32_t k = 0; commands[k] != '\0'; k++) {
    if (word[0] == commands[k] && word[1] == '\0') {
      return true;
    }
  }
  return false;
}

static const char *execute(char *text) {
  segment_settings_t set = segment.set;
  int32_t turn_q32 = 0;
  int32_t run[2] = {0, 0};
  for (char *word = next_word(&text); word != 0; word = next_word(&text)) {
    int32_t n[NUMBERS_MAX] = {0};
    if (!known(word)) {
      return "unknown command";
    }
    const uint32_t count = numbers_of(word[0]);
    for (uint32_t k = 0; k < count; k++) {
      char *number = next_word(&text);
      if (number == 0 || !parse_i32(number, &n[k])) {
        return "a number is missing";
      }
    }
    if (word[0] == 'r') {
      run[0] = n[0];
      run[1] = n[1];
    } else {
      apply(&set, word[0], n, &turn_q32);
    }
  }
  if (run[0] < 0 || (run[0] > 0 && (run[1] < 1 || run[1] > (int32_t)BLOCK_TICKS_MAX))) {
    return "a block has 1 to 512 ticks";
  }
  const uint32_t state = critical_enter();
  segment.set = set;
  segment.silent_ticks = 0;
  segment.forsaken = segment.forsaken && set.mode != SEGMENT_OFF;
  segment.turn_q32 += turn_q32;
  segment_run(&segment, (uint32_t)run[0], (uint32_t)run[1]);
  critical_leave(state);
  return tell();
}

// Why nothing can be measured by these parameters; 0: it can. A regulator step that waits for the core would wait, and
// interrupt it, until the update; the tick after it never comes.
static const char *refusal(const parameter_block_t *block) {
  const fault_t fault = parameters_check(block);
  if (fault != FAULT_NONE) {
    return fault_name(fault);
  }
  return (block->parameters.vector_direct != 0) ? "vector_direct is 1; the hardware's regulator measures, set it to 0" : 0;
}

static void answer(const char *refused) {
  const char *error = line_check(&line);
  if (error == 0) {
    error = (refused == 0) ? execute(line_text) : refused;
  }
  line_answer(&line, error);
}

int main(void) {
  const parameter_block_t *block = cpu_parameter_block();
  const char *refused = refusal(block);
  p = &block->parameters;
  chip_gates_off();
  uart_configure(UART_BIT_CYCLES);
  if (refused == 0) {
    chip_configure(p);
    segment_init(&segment, p);
    chip_irq_configure((uint32_t)IRQ_TICK | (uint32_t)IRQ_TRIP, 0);
    chip_set_tick((uint32_t)p->tick_cycles);
    trap_enable();
  }
  for (;;) {
    const uint32_t word = uart_take();
    const uint32_t count = (word != 0u) ? uart_text_length(word) : 0u;
    for (uint32_t i = 0; i < count; i++) {
      if (line_add(&line, uart_text(word, i))) {
        answer(refused);
      }
    }
  }
}
