// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "drive/drive.h"

#include "control/carrier.h"
#include "control/fixed.h"
#include "control/placement.h"
#include "control/speed.h"
#include "drive/hall.h"
#include "drive/measure.h"
#include "drive/protect.h"
#include "drive/run.h"
#include "drive/start.h"
#include "drive/thresholds.h"
#include "drive/vector.h"

#define INIT_SETTLE_TICKS 5u
#define AUTO_ZERO_MIN_TICKS 3u
#define SILENT_TICKS 3u
// Ticks after a clear in which the latched trips may still be the old ones.
#define CLEAR_TICKS 2u
#define MISSES_BEFORE_TRIP 2u
// 5 ms at 10 kHz.
#define OUTRUN_TICKS 50u
// The slow protection looks at every eighth tick, never at one that the watchdog hears of too (REPORT_TICKS of app.c).
#define LOOK_TICKS 8u
#define LOOK_AT 2u
#define MID_CODE_Q4 (2048 * 16)
// Trips that mean nothing while the gates are off anyway.
#define TRIPS_OF_RUNNING (TRIP_LOST_LOCK | TRIP_UNDER_VOLTAGE)
#define TRIPS_OF_CURRENT (TRIP_PHASE_CURRENT | TRIP_DC_CURRENT)

const char *drive_state_name(drive_state_t state) {
  static const char *const names[] = STATE_WORDS;
  return names[state];
}

const char *drive_phase_name(phase_t phase) {
  static const char *const names[] = PHASE_WORDS;
  return names[phase];
}

const char *drive_limit_name(limit_t limit) {
  static const char *const names[] = LIMIT_WORDS;
  return names[limit];
}

COLD void drive_enter(drive_t *drive, drive_state_t state) {
  drive->state = state;
  drive->command.write_modes = true;
  drive->command.read_sectors = false;
  drive->command.read_phases = false;
  drive->state_ticks = 0;
  drive->limit = LIMIT_NONE;
}

COLD void drive_gates_off(drive_t *drive) {
  chip_command_t *command = &drive->command;
  command->gate_enable = false;
  command->sequencer = SEQUENCER_OFF;
  command->timer = COMMUTATION_OFF;
  command->zcd_enable = false;
  command->sampling = SAMPLING_CONTINUOUS;
  command->miss_limit = 0;
  command->force_on_miss = false;
  command->pulse_cycles_q8 = 0;
  for (uint32_t x = 0; x < PHASES; x++) {
    command->leg[x] = LEG_OFF;
  }
  drive->u_v_q25 = 0;
  drive->duty_q30 = 0;
  vector_off(drive);
}

COLD void drive_enter_fault(drive_t *drive, fault_t fault) {
  drive_gates_off(drive);
  drive_enter(drive, STATE_FAULT);
  drive->fault = fault;
  fault_log_add(&drive->log, fault, drive->tick);
}

COLD void drive_take_crossing(drive_t *drive) {
  const bool other_signal = drive->command.crossing.zcd_source != drive->settings.crossing.zcd_source;
  drive->command.crossing = drive->settings.crossing;
  if (other_signal) {
    thresholds_reset(drive);
  }
}

HOT void drive_apply_voltage(drive_t *drive, int32_t u_v_q25, bool sync_rect) {
  const parameters_t *p = drive->p;
  const int32_t diode = sync_rect ? 0 : p->diode_v_q25;
  const uint32_t dead_time = sync_rect ? (uint32_t)p->dead_time_cycles : 0u;
  drive->u_v_q25 = u_v_q25;
  drive->duty_q30 = duty_from_voltage_q30(u_v_q25, drive->m.vdc_v_q25, diode);
  const uint32_t period_cycles =
      carrier_period_cycles(drive->duty_q30, drive->settings.carrier_period_cycles,
                            drive->m.longest_cycles, (uint32_t)p->on_time_floor_cycles);
  int32_t duty_q30 = drive->duty_q30;
  if (drive->settings.linearity && drive->settings.commutation == COMMUTATION_CSC &&
      (drive->state == STATE_RUNNING || drive->state == STATE_STOPPING)) {
    duty_q30 = csc_linear_duty_q30(&drive->scheduled.linearity, duty_q30);
  }
  drive->command.sync_rect = sync_rect;
  drive->command.period_cycles = period_cycles;
  drive->command.pulse_cycles_q8 = pulse_cycles_q8(duty_q30, period_cycles, dead_time);
}

bool drive_turns_wrong(const drive_t *drive) {
  const int32_t target = drive->settings.target_rpm;
  return target != 0 && (target < 0) != drive->reverse;
}

HOT int32_t drive_target_rpm_q8(const drive_t *drive) {
  const parameters_t *p = drive->p;
  const int32_t target = drive->reverse ? -drive->settings.target_rpm : drive->settings.target_rpm;
  return clamp_i32(target, p->stop_rpm, p->speed_max_rpm) * 256;
}

SMALL_CODE_BEGIN
COLD void drive_init(drive_t *drive, const parameters_t *parameters, fault_t fault) {
  __builtin_memset(drive, 0, sizeof *drive);  // as app_boot does
  drive->p = (fault == FAULT_NONE) ? parameters : 0;
  drive->state = STATE_INIT;
  drive->fault = fault;
  drive->command.period_cycles = 1250;
  drive->command.sampling = SAMPLING_CONTINUOUS;
  drive->command.forced_interval_cycles = 0xFFFFFF;
  if (fault != FAULT_NONE) {
    fault_log_add(&drive->log, fault, 0);
    return;
  }
  const parameters_t *p = parameters;
  drive->speed_numerator_q8 = speed_numerator_q8((uint32_t)p->clock_hz, (uint32_t)p->pole_pairs);
  const settings_t *s = &drive->settings;
  settings_init(&drive->settings, p);
  drive->command.crossing = s->crossing;
  drive->command.commutation = s->commutation;
  drive->command.pattern = s->pattern;
  drive->command.advance_q16 = s->advance_q16;
  drive->command.timeout_q12 = (uint32_t)p->timeout_q12;
  drive->command.period_cycles = (uint32_t)p->carrier_longest_cycles;
  thresholds_reset(drive);
  hall_init(drive);
  if (method_is_vector(p->method)) {
    vector_init(drive);
  }
}
SMALL_CODE_END

// Let samples settle, measure the current offsets with the gates off, judge them.
COLD void drive_init_step(drive_t *drive, const chip_snapshot_t *in) {
  if (drive->state_ticks <= INIT_SETTLE_TICKS) {
    drive->command.start_auto_zero = drive->state_ticks == INIT_SETTLE_TICKS;
    return;
  }
  if (drive->state_ticks < INIT_SETTLE_TICKS + AUTO_ZERO_MIN_TICKS || in->auto_zero_busy) {
    return;
  }
  for (uint32_t i = 0; i < CURRENT_CHANNELS; i++) {
    const int32_t deviation = abs_sat((int32_t)in->current_code_offset_q4[i] - MID_CODE_Q4);
    if (deviation > drive->p->offset_limit_lsb * 16) {
      drive_enter_fault(drive, FAULT_CURRENT_OFFSET);
      return;
    }
  }
  drive->fault = FAULT_NONE;
  drive_enter(drive, STATE_READY);
}

// A lost lock restarts the drive as often as the parameters allow.
COLD void drive_lost_lock(drive_t *drive) {
  drive->lost_locks++;
  thresholds_reset(drive);
  if (drive->state == STATE_STARTING) {
    start_failed(drive);
  } else if (drive->state == STATE_STOPPING) {
    drive_gates_off(drive);
    drive_enter(drive, STATE_READY);
  } else if (drive->restarts >= (uint32_t)drive->p->restart_retries) {
    drive_enter_fault(drive, FAULT_LOST_LOCK);
  } else {
    drive->restarts++;
    hall_resort(drive);
    start_begin(drive);
  }
}

static bool is_over_current(fault_t fault) {
  return fault == FAULT_PHASE_OVER_CURRENT || fault == FAULT_DC_OVER_CURRENT;
}

// A drive that has lost its lock drives current against the EMF: an over-current after missed crossings, or at a speed that
// no rotor has, is its consequence, not a fault of its own; nor is one before the lock is there, or as the precharge of the
// restart shorts a rotor whose EMF was not seen. With one voltage channel dead every third crossing is missed, never two
// in a row: all of the last 64 to 128 ticks count. While starting a short circuit looks the same: once may be chance.
COLD static bool excuses_over_current(drive_t *drive, const chip_snapshot_t *in, bool impossible) {
  const uint8_t lately = (uint8_t)(in->timeouts - drive->m.timeouts_before);
  const bool missed = drive->command.timer == COMMUTATION_ZCD &&
                      (in->misses >= MISSES_BEFORE_TRIP || lately >= MISSES_BEFORE_TRIP);
  const bool lost = missed || impossible || (in->trip_first & TRIP_LOST_LOCK) != 0u || hall_blames_crossings(drive);
  if (drive->state != STATE_STARTING) {
    return drive->state == STATE_RUNNING && lost;
  }
  const bool unseen = drive->restarts > 0u && drive->phase == START_PRECHARGE;
  const bool excused = !drive->start_excused && (lost || unseen || drive->phase == START_LOCK);
  drive->start_excused = drive->start_excused || excused;
  return excused;
}

// Of the latched trips those that a lost lock explains; a link that falls after another one is judged by the start. A drive
// that is ready has no lock to lose.
COLD static uint32_t explained_trips(drive_t *drive, const chip_snapshot_t *in, uint32_t first, bool impossible) {
  if (drive->state == STATE_READY) {
    return 0;
  }
  uint32_t explained = TRIP_LOST_LOCK | (TRIP_UNDER_VOLTAGE & ~first);
  const uint32_t over_current = in->trip_latched & TRIPS_OF_CURRENT;
  if (over_current != 0u && excuses_over_current(drive, in, impossible)) {
    explained |= TRIPS_OF_CURRENT;
    fault_log_add(&drive->log, fault_of_trip(over_current), drive->tick);
  }
  return explained;
}

// A rotor that jams loses its lock without a missed crossing; soon after a start there has been no lock.
COLD static void lose_lock(drive_t *drive, bool impossible) {
  const bool soon = drive->state == STATE_RUNNING && drive->state_ticks < (uint32_t)drive->p->restart_clear_ticks;
  if (impossible && soon) {
    start_failed(drive);
  } else {
    drive_lost_lock(drive);
  }
}

// Gates are off already when a trip is seen here: this gives it its name. Only what is explained is cleared unnamed by the
// restart. True: the state has been left.
COLD static bool handle_trips(drive_t *drive, const chip_snapshot_t *in, bool impossible) {
  const bool coasting = drive->state == STATE_STARTING && drive->phase == START_COAST;
  const bool clearing = coasting && drive->state_ticks <= CLEAR_TICKS;
  const uint32_t counts = (drive->state == STATE_READY) ? ~(uint32_t)TRIPS_OF_RUNNING : UINT32_MAX;
  const uint32_t latched = in->trip_latched & counts;
  const uint32_t first = ((in->trip_first != 0u) ? in->trip_first : in->trip_latched) & counts;
  if (latched == 0u || clearing) {
    return false;
  }
  const uint32_t rest = latched & ~explained_trips(drive, in, first, impossible);
  if (rest == 0u) {
    lose_lock(drive, impossible);
    return true;
  }
  const uint32_t causes = ((first & rest) != 0u) ? first & rest : rest;
  const fault_t fault = (causes & ~(uint32_t)TRIP_DEADLINE) == 0u ? fault_of_monitor(in->trip_monitor)
                                                                  : fault_of_trip(causes);
  const bool by_sensors = is_over_current(fault) && drive->hall.driving && drive->hall.suspicion > 0u;
  drive_enter_fault(drive, by_sensors ? FAULT_HALL_SENSOR : fault);
  return true;
}

// The edges that commutate have become useless, or stay away: a rotor that is blocked. True: the state has been left.
COLD static bool sensors_lost(drive_t *drive) {
  if (drive->state == STATE_READY) {
    return false;
  }
  if (drive->hall.faulty) {
    drive_enter_fault(drive, FAULT_HALL_SENSOR);
    return true;
  }
  if (drive->state == STATE_STARTING) {
    return false;  // it has its own patience
  }
  drive_lost_lock(drive);
  return true;
}

bool drive_outruns_voltage(const drive_t *drive, int32_t drop_v_q25) {
  const int32_t emf_v_q25 = gain_apply(drive->m.speed_rpm_q8, drive->p->emf);
  return drive->command.timer == COMMUTATION_ZCD && emf_v_q25 / 4 > drive->u_v_q25 - drop_v_q25;
}

// No rotor turns at the measured speed.
HOT static bool speed_impossible(drive_t *drive, bool over) {
  // The phases' current is right however seldom it is sampled; braking it drops nothing.
  const int32_t driving_i_q25 = (drive->m.idc_q17 > 0) ? drive->m.motor_q17 * 256 : 0;
  const bool outruns = drive_outruns_voltage(drive, gain_apply(driving_i_q25, drive->scheduled.resistance));
  drive->outrun_ticks = outruns ? drive->outrun_ticks + 1u : 0u;
  if (drive->outrun_ticks < OUTRUN_TICKS && !(over && outruns)) {
    return false;
  }
  drive->outrun_ticks = 0;
  return true;
}

HOT bool drive_supervise(drive_t *drive, const chip_snapshot_t *in) {
  if (drive->state == STATE_INIT || drive->state == STATE_FAULT) {
    return false;
  }
  if (drive->m.silent_ticks >= SILENT_TICKS) {
    drive_enter_fault(drive, FAULT_NO_SAMPLES);
    return true;
  }
  const bool turning = drive->m.speed_valid && (drive->state == STATE_RUNNING || drive->state == STATE_STOPPING);
  const bool over = turning && drive->m.speed_rpm_q8 / 256 > drive->p->overspeed_rpm;
  const bool impossible = turning && speed_impossible(drive, over);
  // Before anything that starts anew, and clears.
  if (in->trip_latched != 0u && handle_trips(drive, in, impossible)) {
    return true;
  }
  if (impossible) {
    lose_lock(drive, impossible);
    return true;
  }
  if (over) {
    drive_enter_fault(drive, FAULT_OVERSPEED);
    return true;
  }
  return drive->hall.driving && (drive->hall.faulty || hall_rotor_stalled(drive)) && sensors_lost(drive);
}

COLD void drive_renew_attempts(drive_t *drive) {
  drive->failed_starts = 0;
  drive->restarts = 0;
  drive->start_excused = false;
}

COLD void drive_handle_request(drive_t *drive) {
  const request_t request = drive->request;
  drive->request = REQUEST_NONE;
  const bool active = drive->state == STATE_STARTING || drive->state == STATE_RUNNING || drive->state == STATE_STOPPING;
  if (request == REQUEST_START && drive->state == STATE_READY) {
    drive_renew_attempts(drive);
    drive->hall.driving = false;
    start_begin(drive);
  } else if (request == REQUEST_STOP && drive->state == STATE_RUNNING) {
    drive_enter(drive, STATE_STOPPING);
  } else if ((request == REQUEST_STOP && drive->state == STATE_STARTING) || (request == REQUEST_STOP_NOW && active)) {
    drive_gates_off(drive);
    drive_enter(drive, STATE_READY);
  } else if (request == REQUEST_CLEAR && drive->state == STATE_FAULT) {
    drive_enter(drive, STATE_INIT);
    drive->command.clear_trips = true;
  }
}

// Slow enough to open the gates of a drive that is to stop: about the stop speed, or where the least duty holds a
// braked rotor above it.
static bool nearly_stopped(const drive_t *drive) {
  const int32_t stop_rpm = drive->p->stop_rpm;
  const int32_t emf_v_q25 = gain_apply(drive->m.speed_rpm_q8, drive->p->emf);
  const bool held = drive->settings.sync_rect && emf_v_q25 < drive->scheduled.low_v_q25 / 4 * 5;
  return drive->m.speed_rpm_q8 < stop_rpm * 256 + stop_rpm * 16 || held;
}

static void stopping_step(drive_t *drive, const chip_snapshot_t *in) {
  const parameters_t *p = drive->p;
  if (p->hall_mode != HALL_OFF) {
    hall_step(drive, in);
  }
  run_step(drive, p->stop_rpm * 256);
  if (nearly_stopped(drive) || drive->state_ticks > (uint32_t)p->stop_timeout_ticks) {
    drive_gates_off(drive);
    drive_enter(drive, STATE_READY);
  }
}

INLINED static void begin_step(drive_t *drive) {
  drive->tick++;
  drive->command.clear_trips = false;
  drive->command.start_auto_zero = false;
  drive->command.write_modes = drive->state != STATE_RUNNING;
  if (drive->state_ticks < UINT32_MAX) {
    drive->state_ticks++;
  }
}

INLINED void drive_vector_step(drive_t *drive, const chip_snapshot_t *in) {
  begin_step(drive);
  vector_drive_step(drive, in);
}

HOT void drive_step(drive_t *drive, const chip_snapshot_t *in) {
  begin_step(drive);
  measure_update(drive, in);
  drive->command.write_offsets = false;
  drive->command.write_thresholds = false;
  drive->command.read_phases = false;
  if (drive->p->hall_mode != HALL_OFF) {
    hall_judge(drive, in);
  }
  if (drive->request != REQUEST_NONE) {
    drive_handle_request(drive);
  }
  if (drive_supervise(drive, in)) {
    return;
  }
  if (drive->tick % LOOK_TICKS == LOOK_AT && protect_step(drive, in, drive->m.motor_q17, LOOK_TICKS)) {
    return;
  }
  switch (drive->state) {
    case STATE_INIT:
      drive_init_step(drive, in);
      break;
    case STATE_STARTING:
      start_step(drive, in);
      break;
    case STATE_RUNNING:
      if (drive->command.timer == COMMUTATION_ZCD) {
        thresholds_step(drive, in);
      }
      if (drive->p->hall_mode != HALL_OFF) {
        hall_step(drive, in);
      }
      run_step(drive, drive_target_rpm_q8(drive));
      if (drive_turns_wrong(drive) && nearly_stopped(drive)) {
        // Reversal: through standstill by a new start.
        start_begin(drive);
        break;
      }
      if (drive->state_ticks == (uint32_t)drive->p->restart_clear_ticks) {
        drive_renew_attempts(drive);
      }
      break;
    case STATE_STOPPING:
      stopping_step(drive, in);
      break;
    case STATE_READY:
    case STATE_FAULT:
    default:
      break;
  }
}
