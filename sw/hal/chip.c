// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "hal/chip.h"

#include "control/placement.h"
#include "hal/reg.h"

#define CHANNELS (2u * PHASES + 3u)
#define CURRENT_OFFSET_Q4 (2048u * 16u)
#define CLEAR_KEY 0xA5u
#define LOCK_KEY 0x10CCu
#define UNITY_GAIN_Q15 0x8000u
#define ALL_TRIPS 0xFFu
#define AUTO_ZERO_LOG2_SAMPLES 6u
// Unclamped samples in the same on-state that a crossing's sample must follow.
#define SAMPLES_BEFORE_MIN 1u
#define SAMPLES_BEFORE_MAX (FL_ZCD_REGS__CONTROL__NEED_PREVIOUS_bm >> FL_ZCD_REGS__CONTROL__NEED_PREVIOUS_bp)
// From the crossing to the commutation, over the interval, before advance.
#define COMMUTATION_DELAY_Q16 0x8000
// Updates in a row without new voltages that trip.
#define VECTOR_MISS_LIMIT 2u

// Channels: voltages and currents of the phases, DC link's voltage and current, star point.
static uint32_t current_channel(uint32_t i) { return (i < PHASES) ? PHASES + i : 2u * PHASES + 1u; }

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
  const uint32_t guard = reg_read(REG(safety.guard));
  const uint32_t polarity = BITS(FL_SAFETY_REGS__GUARD__HIGH_ACTIVE_LOW, guard) |
                            BITS(FL_SAFETY_REGS__GUARD__LOW_ACTIVE_LOW, guard) << 1;
  return (reg_read(REG(sys.blocks)) & used) == used && polarity == (uint32_t)p->gate_polarity;
}

uint32_t chip_clock_hz(void) { return reg_read(REG(sys.clock)); }
HOT uint32_t chip_now(void) { return reg_read(REG(sys.time_now)); }
HOT uint32_t chip_tick_time(void) { return reg_read(REG(timer.tick_time)); }
void chip_set_tick(uint32_t cycles) { reg_write(REG(timer.tick_period), cycles); }
void chip_set_load(uint32_t cycles) { reg_write(REG(timer.load_period), cycles); }
void chip_set_machine_timer(uint32_t cycles) { reg_write(REG(timer.machine_period), cycles); }
void chip_tick_by_time(void) { reg_write(REG(timer.tick_samples), 0); }
HOT void chip_report_step(uint32_t step) { reg_write(REG(safety.feed), step & 0xFFu); }
void chip_gates_off(void) { reg_write(REG(safety.guard), 0); }

static void write_scheduler(uint32_t sampling, uint32_t offset_cycles) {
  reg_write(REG(sense.scheduler), FIELD(FL_SENSE_REGS__SCHEDULER__MODE, sampling) |
                                      FIELD(FL_SENSE_REGS__SCHEDULER__OFFSET_CYCLES, offset_cycles));
}

COLD void chip_shift_samples(const parameters_t *parameters, uint32_t cycles) {
  write_scheduler((uint32_t)parameters->sample_mode, (uint32_t)parameters->sample_offset_cycles + cycles);
}

SMALL_CODE_BEGIN
COLD static void configure_sensing(const parameters_t *p) {
  reg_write(REG(sense.period), (uint32_t)p->sample_period_cycles);
  reg_write(REG(sense.delay), (uint32_t)p->sense_delay_cycles);
  for (uint32_t c = 0; c < CHANNELS; c++) {
    reg_write(REG(sense.gain[0]) + 4u * c, UNITY_GAIN_Q15);
    reg_write(REG(sense.offset[0]) + 4u * c, 0);
  }
  for (uint32_t i = 0; i < CURRENT_CHANNELS; i++) {
    reg_write(REG(sense.offset[0]) + 4u * current_channel(i), CURRENT_OFFSET_Q4);
  }
  write_scheduler(SAMPLING_CONTINUOUS, (uint32_t)p->sample_offset_cycles);
}

COLD static void configure_crossings(const parameters_t *p) {
  reg_write(REG(zcd.blanking), FIELD(FL_ZCD_REGS__BLANKING__SETTLE_CYCLES, p->zcd_settle_cycles) |
                                   FIELD(FL_ZCD_REGS__BLANKING__BLANK_CYCLES, p->zcd_blank_cycles));
  for (uint32_t sector = 0; sector < 6u; sector++) {
    reg_write(REG(zcd.threshold[0]) + 4u * sector, (uint32_t)p->zcd_threshold_q17[sector]);
  }
  reg_write(REG(comm.latency), (uint32_t)p->latency_cycles);
}

COLD static void configure_safety(const parameters_t *p) {
  reg_write(REG(safety.guard), FIELD(FL_SAFETY_REGS__GUARD__SAFE_STATE, p->safe_state));
  reg_write(REG(safety.dead_time), (uint32_t)p->dead_time_cycles);
  reg_write(REG(safety.current_limit), FIELD(FL_SAFETY_REGS__CURRENT_LIMIT__PHASE_LSB, p->trip_phase_lsb) |
                                           FIELD(FL_SAFETY_REGS__CURRENT_LIMIT__DC_LSB, p->trip_dc_lsb));
  reg_write(REG(safety.voltage_limit), FIELD(FL_SAFETY_REGS__VOLTAGE_LIMIT__OVER_LSB, p->trip_over_voltage_lsb) |
                                           FIELD(FL_SAFETY_REGS__VOLTAGE_LIMIT__UNDER_LSB, p->trip_under_voltage_lsb));
  reg_write(REG(safety.trip_enable), ALL_TRIPS);
  reg_write(REG(safety.watchdog), (uint32_t)p->watchdog_cycles);
  reg_write(REG(safety.brake_level), FIELD(FL_SAFETY_REGS__BRAKE_LEVEL__ON_LSB, p->brake_on_lsb) |
                                         FIELD(FL_SAFETY_REGS__BRAKE_LEVEL__OFF_LSB, p->brake_off_lsb));
  reg_write(REG(safety.brake_time), (uint32_t)p->brake_longest_cycles);
  reg_write(REG(safety.sample_age), (uint32_t)p->sample_age_cycles);
  reg_write(REG(safety.brake), FIELD(FL_SAFETY_REGS__BRAKE__ENABLE, p->brake_longest_cycles != 0 ? 1 : 0));
  reg_write(REG(safety.lock), LOCK_KEY);
  reg_write(REG(safety.command), FIELD(FL_SAFETY_REGS__COMMAND__CLEAR_KEY, CLEAR_KEY));
}
SMALL_CODE_END

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
COLD static void configure_vector(const parameters_t *p) {
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
  reg_write(REG(encoder.filter), (uint32_t)p->encoder_filter_cycles);
  reg_write(REG(encoder.turn), FIELD(FL_ENCODER_REGS__TURN__LAST, p->encoder_quarters - 1) |
                                   FIELD(FL_ENCODER_REGS__TURN__INDEX, p->encoder_index));
  chip_shift_samples(p, 0);
  reg_write(REG(timer.update), FIELD(FL_TIMER_REGS__UPDATE__COMMIT, 1));
}
SMALL_CODE_END

SMALL_CODE_BEGIN
COLD void chip_configure(const parameters_t *parameters) {
  configure_safety(parameters);
  configure_sensing(parameters);
  configure_crossings(parameters);
  reg_write(REG(freewheel.threshold), (uint32_t)parameters->freewheel_limit_q17);
  reg_write(REG(freewheel.control), FIELD(FL_FREEWHEEL_REGS__CONTROL__ENABLE, 1));
  reg_write(REG(hall.filter), (uint32_t)parameters->hall_filter_cycles);
  reg_write(REG(pwm.min_pulse), (uint32_t)parameters->min_pulse_cycles);
  if (method_is_vector(parameters->method)) {
    configure_vector(parameters);
    if (parameters->injection != 0 && (HELD & HELD_INJECTION) != 0) {
      chip_configure_injection(parameters);
    }
  }
}
SMALL_CODE_END

HOT static void read_sums(chip_snapshot_t *snapshot) {
  snapshot->sample_number = reg_read(REG(sense.snap_number));
  snapshot->vdc_sum_q17 = (int32_t)reg_read(REG(sense.snap_vdc_sum));
  snapshot->idc_sum_q17 = (int32_t)reg_read(REG(sense.snap_idc_sum));
  snapshot->sum_count = reg_read(REG(sense.snap_count));
}

HOT static void read_trips(chip_snapshot_t *snapshot) {
  const uint32_t trip = reg_read(REG(safety.trip));
  snapshot->trip_latched = (uint8_t)BITS(FL_SAFETY_REGS__TRIP__LATCHED, trip);
  snapshot->trip_first = (uint8_t)BITS(FL_SAFETY_REGS__TRIP__FIRST, trip);
  if (__builtin_expect((snapshot->trip_latched & TRIP_DEADLINE) != 0u, 0)) {
    snapshot->trip_monitor = (uint8_t)BITS(FL_SAFETY_REGS__MONITOR__CAUSE, reg_read(REG(safety.monitor)));
  }
}

HOT static void read_voltages(chip_snapshot_t *snapshot) {
  for (uint32_t x = 0; x < PHASES; x++) {
    snapshot->v_q17[x] = (int32_t)reg_read(REG(sense.snap_channel[0]) + 4u * x);
  }
}

HOT static void read_currents(chip_snapshot_t *snapshot) {
  for (uint32_t x = 0; x < PHASES; x++) {
    snapshot->i_q17[x] = (int32_t)reg_read(REG(sense.snap_channel[0]) + 4u * (PHASES + x));
  }
}

HOT void chip_read(chip_snapshot_t *snapshot, bool voltages) {
  read_sums(snapshot);
  read_currents(snapshot);
  if (voltages) {
    read_voltages(snapshot);
  }
  snapshot->zc_interval_cycles = reg_read(REG(comm.snap_interval));
  snapshot->zc_period_cycles = reg_read(REG(comm.snap_period));
  const uint32_t counters = reg_read(REG(comm.snap_counters));
  snapshot->crossings = (uint16_t)BITS(FL_COMM_REGS__SNAP_COUNTERS__CROSSINGS, counters);
  snapshot->misses = (uint8_t)BITS(FL_COMM_REGS__SNAP_COUNTERS__MISSES, counters);
  const uint32_t late = BITS(FL_ZCD_REGS__COUNTERS__LATE, reg_read(REG(zcd.counters)));
  snapshot->late = (uint8_t)(late - BITS(FL_ZCD_REGS__METHOD_COUNTERS__BACK, reg_read(REG(zcd.method_counters))));
  const uint32_t events = reg_read(REG(comm.snap_events));
  snapshot->commutations = (uint16_t)BITS(FL_COMM_REGS__SNAP_EVENTS__COMMUTATIONS, events);
  snapshot->overdue = (uint8_t)BITS(FL_COMM_REGS__SNAP_EVENTS__OVERDUE, events);
  snapshot->timeouts = (uint8_t)BITS(FL_COMM_REGS__SNAP_EVENTS__TIMEOUTS, events);
  read_trips(snapshot);
}

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
  read_sums(snapshot);
  read_voltages(snapshot);
}

INLINED void chip_read_vector(chip_snapshot_t *snapshot, const vector_command_t *command, const parameters_t *parameters) {
  chip_vector_snapshot_t *v = &snapshot->vector;
  read_trips(snapshot);
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
  v->taken = BITS(FL_TIMER_REGS__UPDATE__PENDING, reg_read(REG(timer.update))) == 0u;
  if (__builtin_expect(parameters->injection != 0 && (HELD & HELD_INJECTION) != 0, 0)) {
    chip_read_injection(&snapshot->injection);
  }
  if (command->look.slow) {
    v->theta_sample_q32 = reg_read(REG(foc.snap_theta_sample));
    read_slow(snapshot);
    const uint32_t counters = reg_read(REG(encoder.counters));
    v->encoder_invalid = (uint16_t)BITS(FL_ENCODER_REGS__COUNTERS__INVALID, counters);
    v->encoder_strayed = (uint16_t)BITS(FL_ENCODER_REGS__COUNTERS__STRAYED, counters);
    if (command->look.currents) {
      read_currents(snapshot);
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

HOT void chip_read_hall(chip_snapshot_t *snapshot) {
  const uint32_t state = reg_read(REG(hall.state));
  const uint32_t counters = reg_read(REG(hall.counters));
  const uint32_t sector = BITS(FL_HALL_REGS__STATE__SECTOR, state);
  snapshot->hall.valid = BITS(FL_HALL_REGS__STATE__VALID, state) != 0u;
  snapshot->hall.backward = BITS(FL_HALL_REGS__STATE__BACKWARD, state) != 0u;
  snapshot->hall.sector = (uint8_t)((sector < 6u) ? sector : 0u);
  snapshot->hall.driven = (uint8_t)BITS(FL_PWM_REGS__STATE__SECTOR, reg_read(REG(pwm.state)));
  snapshot->hall.edges = (uint16_t)BITS(FL_HALL_REGS__COUNTERS__EDGES, counters);
  snapshot->hall.invalid = (uint8_t)BITS(FL_HALL_REGS__COUNTERS__INVALID, counters);
  snapshot->hall.skipped = (uint8_t)BITS(FL_HALL_REGS__COUNTERS__SKIPPED, counters);
  snapshot->hall.phase_cycles = reg_read(REG(hall.phase[0]) + 4u * snapshot->hall.sector);
}

HOT void chip_read_freewheel(chip_freewheel_t *freewheel) {
  const uint32_t count = reg_read(REG(freewheel.snap_count));
  if (count != 0u) {
    freewheel->count = count;
    freewheel->sum_cycles = reg_read(REG(freewheel.snap_sum));
    freewheel->max = reg_read(REG(freewheel.snap_max));
  }
}

COLD void chip_read_offsets(chip_snapshot_t *snapshot) {
  snapshot->auto_zero_busy = BITS(FL_SENSE_REGS__AUTO_ZERO__BUSY, reg_read(REG(sense.auto_zero))) != 0u;
  for (uint32_t i = 0; i < CURRENT_CHANNELS; i++) {
    snapshot->current_code_offset_q4[i] =
        (uint16_t)(reg_read(REG(sense.offset[0]) + 4u * current_channel(i)) & 0xFFFFu);
  }
}

COLD void chip_read_sectors(chip_snapshot_t *snapshot) {
  for (uint32_t sector = 0; sector < 6u; sector++) {
    snapshot->sector_interval_cycles[sector] = reg_read(REG(comm.snap_sector_interval[0]) + 4u * sector);
  }
}

COLD void chip_read_phases(chip_snapshot_t *snapshot) {
  for (uint32_t sector = 0; sector < 6u; sector++) {
    snapshot->hall_phase_cycles[sector] = reg_read(REG(hall.phase[0]) + 4u * sector);
  }
}

COLD static void write_edges(const edge_command_t *command) {
  for (uint32_t sector = 0; sector < 6u; sector++) {
    reg_write(REG(comm.hall_offset[0]) + 4u * sector, (uint32_t)command->q16[sector] & 0xFFFFu);
  }
}

COLD static void write_thresholds(const threshold_command_t *command) {
  for (uint32_t sector = 0; sector < 6u; sector++) {
    reg_write(REG(zcd.threshold[0]) + 4u * sector, (uint32_t)command->q17[sector]);
  }
}

// A diode that lets the terminal go is an edge that no gate tells: after it the samples wait as long as after one of a gate.
// The settle time holds a sample, that of the clamp. One sample a pulse has none before it.
COLD static uint32_t samples_before(uint32_t sampling, const parameters_t *p) {
  if (sampling == SAMPLING_ONCE) {
    return 0;
  }
  const uint32_t waits = (uint32_t)p->zcd_settle_cycles / (uint32_t)p->sample_period_cycles;
  if (waits <= SAMPLES_BEFORE_MIN) {
    return SAMPLES_BEFORE_MIN;
  }
  return (waits > SAMPLES_BEFORE_MAX) ? SAMPLES_BEFORE_MAX : waits - 1u;
}

// What stays as it is while the drive runs. Averaging and computing back use the mean interval: the last one alternates
// with every asymmetry and closes a loop through crossings that are computed back.
COLD static void write_sequence(const sequence_command_t *command, const parameters_t *p) {
  const crossing_settings_t crossing = command->crossing;
  write_scheduler(command->sampling, (uint32_t)p->sample_offset_cycles);
  reg_write(REG(pwm.control), FIELD(FL_PWM_REGS__CONTROL__MODE, command->sequencer) |
                                  FIELD(FL_PWM_REGS__CONTROL__COMMUTATION, command->commutation) |
                                  FIELD(FL_PWM_REGS__CONTROL__PATTERN, command->pattern) |
                                  FIELD(FL_PWM_REGS__CONTROL__SYNC_RECT, command->sync_rect ? 1 : 0) |
                                  FIELD(FL_PWM_REGS__CONTROL__BACKWARD, command->reverse ? 1 : 0) |
                                  FIELD(FL_PWM_REGS__CONTROL__START_SECTOR, command->start_sector) |
                                  FIELD(FL_PWM_REGS__CONTROL__START_HALL, command->timer == COMMUTATION_HALL ? 1 : 0));
  reg_write(REG(pwm.manual), FIELD(FL_PWM_REGS__MANUAL__LEG_A, command->leg[0]) |
                                 FIELD(FL_PWM_REGS__MANUAL__LEG_B, command->leg[1]) |
                                 FIELD(FL_PWM_REGS__MANUAL__LEG_C, command->leg[2]));
  reg_write(REG(zcd.control), FIELD(FL_ZCD_REGS__CONTROL__ENABLE, command->zcd_enable ? 1 : 0) |
                                  FIELD(FL_ZCD_REGS__CONTROL__METHOD, crossing.zcd_method) |
                                  FIELD(FL_ZCD_REGS__CONTROL__COMPUTE_BACK, crossing.compute_back ? 1 : 0) |
                                  FIELD(FL_ZCD_REGS__CONTROL__NEED_PREVIOUS, samples_before(command->sampling, p)) |
                                  FIELD(FL_ZCD_REGS__CONTROL__LINEAR, p->zcd_linear) |
                                  FIELD(FL_ZCD_REGS__CONTROL__USE_MEAN, 1) |
                                  FIELD(FL_ZCD_REGS__CONTROL__SOURCE, crossing.zcd_source));
  reg_write(REG(zcd.clamp),
            (uint32_t)((crossing.zcd_source == ZCD_SOURCE_TERMINAL) ? p->zcd_margin_q17 : p->zcd_margin_third_q17));
  reg_write(REG(comm.control), FIELD(FL_COMM_REGS__CONTROL__MODE, command->timer) |
                                   FIELD(FL_COMM_REGS__CONTROL__FORCE_ON_MISS, command->force_on_miss ? 1 : 0) |
                                   FIELD(FL_COMM_REGS__CONTROL__CORRECTION_A, crossing.correction_a ? 1 : 0) |
                                   FIELD(FL_COMM_REGS__CONTROL__HALL_TIMED, 1) |
                                   FIELD(FL_COMM_REGS__CONTROL__MISS_LIMIT, command->miss_limit));
  reg_write(REG(comm.timeout), command->timeout_q12);
  reg_write(REG(comm.forced_interval), command->forced_interval_cycles);
}

// What the control loop moves. The wait of an averaged crossing ends half-way to the commutation.
HOT static void write_loop(const loop_command_t *command, uint8_t source) {
  const int32_t delay_q16 = COMMUTATION_DELAY_Q16 - command->advance_q16;
  const uint32_t peak_q17 = command->peak_q17;
  reg_write(REG(pwm.period), command->period_cycles);
  reg_write(REG(pwm.duty), command->pulse_cycles_q8);
  reg_write(REG(comm.delay), FIELD(FL_COMM_REGS__DELAY__INTERVAL_Q16, COMMUTATION_DELAY_Q16) |
                                 FIELD(FL_COMM_REGS__DELAY__ADVANCE_Q16, (uint32_t)command->advance_q16 & 0xFFFFu));
  reg_write(REG(zcd.wait_limit), (delay_q16 > 0) ? (uint32_t)delay_q16 >> 9 : 0u);
  reg_write(REG(zcd.amplitude), (source == ZCD_SOURCE_TERMINAL) ? peak_q17 : peak_q17 / 3u);
}

SMALL_CODE_BEGIN
COLD static void start_auto_zero(void) {
  uint32_t mask = 0;
  for (uint32_t i = 0; i < CURRENT_CHANNELS; i++) {
    mask |= 1u << current_channel(i);
  }
  reg_write(REG(sense.auto_zero), FIELD(FL_SENSE_REGS__AUTO_ZERO__START, 1) |
                                      FIELD(FL_SENSE_REGS__AUTO_ZERO__LOG2_SAMPLES, AUTO_ZERO_LOG2_SAMPLES) |
                                      FIELD(FL_SENSE_REGS__AUTO_ZERO__MASK, mask));
}
SMALL_CODE_END

HOT void chip_write(six_step_command_t *command, const parameters_t *parameters) {
  if (command->sequence.fresh) {
    write_sequence(&command->sequence, parameters);
    command->sequence.fresh = false;
  }
  write_loop(&command->loop, command->sequence.crossing.zcd_source);
  if (command->threshold.fresh) {
    write_thresholds(&command->threshold);
    command->threshold.fresh = false;
  }
  if (command->edge.fresh) {
    write_edges(&command->edge);
    command->edge.fresh = false;
  }
  reg_write(REG(timer.update), FIELD(FL_TIMER_REGS__UPDATE__COMMIT, 1));
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
    reg_write(REG(timer.tick_samples), (uint32_t)samples);
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
  reg_write(REG(timer.update), FIELD(FL_TIMER_REGS__UPDATE__COMMIT, 1));
}

COLD void chip_write_guard(guard_command_t *command) {
  if (command->clear_trips) {
    reg_write(REG(safety.command), FIELD(FL_SAFETY_REGS__COMMAND__CLEAR_KEY, CLEAR_KEY));
  }
  reg_write(REG(safety.guard), FIELD(FL_SAFETY_REGS__GUARD__ENABLE, command->enable ? 1 : 0));
  if (command->start_auto_zero) {
    start_auto_zero();
  }
  command->clear_trips = false;
  command->start_auto_zero = false;
  command->fresh = false;
}

COLD void chip_irq_configure(uint32_t control, uint32_t deferred) {
  reg_write(REG(irq.route), control);
  reg_write(REG(irq.pending), control | deferred);
  reg_write(REG(irq.enable), control | deferred);
}

HOT uint32_t chip_irq_pending(void) { return reg_read(REG(irq.pending)); }
HOT void chip_irq_clear(uint32_t sources) { reg_write(REG(irq.pending), sources); }

uint32_t chip_tick_overruns(void) { return BITS(FL_IRQ_REGS__OVERRUN__TICK_COUNT, reg_read(REG(irq.overrun))); }
uint32_t chip_all_overruns(void) { return BITS(FL_IRQ_REGS__OVERRUN__COUNT, reg_read(REG(irq.overrun))); }

trip_record_t chip_trip_record(uint32_t index) {
  reg_write(REG(safety.log_index), index);
  const uint32_t cause = reg_read(REG(safety.log_cause));
  trip_record_t record;
  record.valid = BITS(FL_SAFETY_REGS__LOG_CAUSE__VALID, cause) != 0u;
  record.causes = BITS(FL_SAFETY_REGS__LOG_CAUSE__CAUSE, cause);
  record.channel = BITS(FL_SAFETY_REGS__LOG_CAUSE__PHASE, cause);
  record.code_lsb = BITS(FL_SAFETY_REGS__LOG_CAUSE__CODE, cause);
  record.stamp = reg_read(REG(safety.log_time));
  return record;
}
