// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "drive/drive.h"

#include "control/fixed.h"
#include "control/placement.h"

#define INIT_SETTLE_TICKS 5u
#define AUTO_ZERO_MIN_TICKS 3u
// A tenth of half the range.
#define OFFSET_LIMIT_Q4 (204 * 16)

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

SMALL_CODE_BEGIN

// What follows from an event in a state.
typedef enum {
  NOTHING,
  READY,    // gates off
  BEGIN,    // start, with all attempts that the parameters allow
  ATTEMPT,  // start again, or the fault of a failed start
  RESTART,  // start again, or the fault of a lost lock
  TURN,     // start again, for the other direction
  LEAD,     // starting, with the gates on
  RUN,
  BRAKE,  // stopping
  FAIL,
  CLEAR,
} action_t;

static const uint8_t actions[EVENT_COUNT][STATE_COUNT] = {
    [EVENT_OFFSETS_KNOWN] = {[STATE_INIT] = READY},
    [EVENT_START] = {[STATE_READY] = BEGIN},
    [EVENT_STOP] = {[STATE_STARTING] = READY, [STATE_RUNNING] = BRAKE},
    [EVENT_STOP_NOW] = {[STATE_STARTING] = READY, [STATE_RUNNING] = READY, [STATE_STOPPING] = READY},
    [EVENT_CLEAR] = {[STATE_FAULT] = CLEAR},
    [EVENT_STARTED] = {[STATE_STARTING] = RUN},
    [EVENT_STOPPED] = {[STATE_STARTING] = READY, [STATE_RUNNING] = READY, [STATE_STOPPING] = READY},
    [EVENT_REVERSE] = {[STATE_RUNNING] = TURN},
    [EVENT_HANDED_BACK] = {[STATE_RUNNING] = LEAD},
    [EVENT_LOCK_LOST] = {[STATE_STARTING] = ATTEMPT, [STATE_RUNNING] = RESTART, [STATE_STOPPING] = READY},
    [EVENT_LOCK_NEVER] = {[STATE_RUNNING] = ATTEMPT},
    [EVENT_START_FAILED] = {[STATE_STARTING] = ATTEMPT},
    [EVENT_PULLED_OUT] = {[STATE_STARTING] = ATTEMPT},
    [EVENT_FAULTED] = {FAIL, FAIL, FAIL, FAIL, FAIL, FAIL},
};

static bool by_vectors(const drive_t *drive) { return method_is_vector(drive->p->method); }

static void off(drive_t *drive) {
  if (by_vectors(drive)) {
    vector_off(&drive->method.vector);
  } else {
    six_step_off(&drive->method.six_step);
  }
}

static void begin(drive_t *drive) {
  if (by_vectors(drive)) {
    vector_start(&drive->method.vector, &drive->order, &drive->settings);
  } else {
    six_step_start(&drive->method.six_step, &drive->order, &drive->settings);
  }
}

static void lost(drive_t *drive) {
  if (!by_vectors(drive)) {
    six_step_lost(&drive->method.six_step);
  }
}

static void enter(drive_t *drive, drive_state_t state) {
  drive->order.state = state;
  drive->order.state_ticks = 0;
}

static void gates_off(drive_t *drive) {
  drive->guard.enable = false;
  drive->guard.fresh = true;
  off(drive);
}

static void clear_trips(drive_t *drive) {
  drive->guard.clear_trips = true;
  drive->guard.fresh = true;
}

static void start(drive_t *drive) {
  gates_off(drive);
  enter(drive, STATE_STARTING);
  begin(drive);
  clear_trips(drive);
}

static void renew_attempts(drive_t *drive) {
  drive->order.failed_starts = 0;
  drive->order.restarts = 0;
  supervise_renew(&drive->supervise);
}

// Another attempt at what has failed `count` times before, of so many that are allowed; false: none is left.
static bool again(drive_t *drive, uint32_t *count, int32_t allowed) {
  if (*count >= (uint32_t)allowed) {
    return false;
  }
  (*count)++;
  drive->order.again = true;
  start(drive);
  return true;
}

// The only place that changes the state, and that logs a fault.
COLD static void follow(drive_t *drive, outcome_t outcome) {
  order_t *order = &drive->order;
  const parameters_t *p = drive->p;
  const event_t event = outcome_event(outcome);
  fault_t fault = outcome_fault_of(outcome);
  action_t action = (action_t)actions[event][order->state];
  if (outcome_passed(outcome) != FAULT_NONE) {
    fault_log_add(&drive->log, outcome_passed(outcome), order->tick);
    order->suspected = order->suspected || fault_is_over_current(outcome_passed(outcome));
  }
  if (event == EVENT_LOCK_LOST || event == EVENT_LOCK_SAVED) {
    drive->lost_locks++;
    lost(drive);
  }
  order->again = false;
  order->requested = false;
  switch (action) {
    case READY:
      drive->fault = FAULT_NONE;
      gates_off(drive);
      enter(drive, STATE_READY);
      break;
    case BEGIN:
      renew_attempts(drive);
      order->requested = true;
      start(drive);
      break;
    case TURN:
      start(drive);
      break;
    case ATTEMPT:
      order->pulled_out = event == EVENT_PULLED_OUT;
      drive->failed_phase = drive->report->phase;
      if (!again(drive, &order->failed_starts, p->start_retries)) {
        fault = (fault != FAULT_NONE) ? fault : FAULT_START_FAILED;
        action = FAIL;
      }
      break;
    case RESTART:
      fault = (fault != FAULT_NONE) ? fault : FAULT_LOST_LOCK;
      action = again(drive, &order->restarts, p->restart_retries) ? RESTART : FAIL;
      break;
    case LEAD:
      enter(drive, STATE_STARTING);
      break;
    case RUN:
      enter(drive, STATE_RUNNING);
      break;
    case BRAKE:
      enter(drive, STATE_STOPPING);
      break;
    case CLEAR:
      enter(drive, STATE_INIT);
      clear_trips(drive);
      break;
    case NOTHING:
    case FAIL:
    default:
      break;
  }
  if (action == FAIL) {
    gates_off(drive);
    enter(drive, STATE_FAULT);
    drive->fault = fault;
  }
  if (fault != FAULT_NONE) {
    fault_log_add(&drive->log, fault, order->tick);
    order->suspected = order->suspected || fault_is_over_current(fault);
  }
}

COLD static void follow_request(drive_t *drive) {
  static const uint8_t events[] = {
      [REQUEST_NONE] = EVENT_STAY,         [REQUEST_START] = EVENT_START, [REQUEST_STOP] = EVENT_STOP,
      [REQUEST_STOP_NOW] = EVENT_STOP_NOW, [REQUEST_CLEAR] = EVENT_CLEAR,
  };
  const request_t request = drive->request;
  drive->request = REQUEST_NONE;
  follow(drive, outcome_of((event_t)events[request]));
}

COLD void drive_init(drive_t *drive, const parameters_t *parameters, fault_t fault) {
  static const report_t none;
  __builtin_memset(drive, 0, sizeof *drive);  // as app_boot does
  drive->report = &none;
  enter(drive, STATE_INIT);
  if (fault != FAULT_NONE) {
    drive->fault = fault;
    fault_log_add(&drive->log, fault, 0);
    return;
  }
  drive->p = parameters;
  settings_init(&drive->settings, parameters);
  if (by_vectors(drive)) {
    vector_init(&drive->method.vector, parameters, &drive->order, &drive->settings);
    drive->report = &drive->method.vector.report;
  } else {
    six_step_init(&drive->method.six_step, parameters, &drive->settings);
    drive->report = &drive->method.six_step.report;
  }
}

void drive_fail(drive_t *drive, fault_t fault) { follow(drive, outcome_fault(fault)); }

void drive_request(drive_t *drive, request_t request) { drive->request = request; }

void drive_heard(drive_t *drive) { drive->heard_tick = drive->order.tick; }

void drive_set(drive_t *drive, const settings_t *settings) {
  drive->settings = *settings;
  drive->settings_fresh = true;
}

// A copy of all settings would hold the control step off for some 200 clocks.
void drive_order(drive_t *drive, const settings_t *order) {
  settings_t *settings = &drive->settings;
  settings->target_rpm = order->target_rpm;
  settings->line = order->line;
  settings->accel_rpm_s = order->accel_rpm_s;
  settings->accel_rpm_q20 = order->accel_rpm_q20;
  settings->accel_rpm_q8 = order->accel_rpm_q8;
  settings->current_limit_q17 = order->current_limit_q17;
  settings->mode = order->mode;
  settings->target_i_q25 = order->target_i_q25;
  drive->settings_fresh = true;
}
SMALL_CODE_END

// Let samples settle, measure the current offsets with the gates off, judge them.
COLD static outcome_t init_step(drive_t *drive, const chip_snapshot_t *in) {
  const uint32_t ticks = drive->order.state_ticks;
  if (ticks <= INIT_SETTLE_TICKS) {
    drive->guard.start_auto_zero = ticks == INIT_SETTLE_TICKS;
    drive->guard.fresh = true;
    return outcome_of(EVENT_STAY);
  }
  if (ticks < INIT_SETTLE_TICKS + AUTO_ZERO_MIN_TICKS || in->auto_zero_busy) {
    return outcome_of(EVENT_STAY);
  }
  for (uint32_t i = 0; i < CURRENT_CHANNELS; i++) {
    const int32_t deviation = abs_sat((int32_t)in->current_code_offset_q4[i] - CODE_MIDDLE_Q4);
    if (deviation > OFFSET_LIMIT_Q4) {
      return outcome_fault(FAULT_CURRENT_OFFSET);
    }
  }
  // Ticks that follow the samples of a vector drive need some.
  const bool sampled = !by_vectors(drive) || in->vector.steps > 0u;
  return sampled ? outcome_of(EVENT_OFFSETS_KNOWN) : outcome_fault(FAULT_NO_SAMPLES);
}

// True: something has happened.
INLINED static bool followed(drive_t *drive, outcome_t outcome) {
  if (__builtin_expect(outcome != 0u, 0)) {
    follow(drive, outcome);
  }
  return outcome_event(outcome) != EVENT_STAY;
}

COLD static bool followed_protection(drive_t *drive, const chip_snapshot_t *in) {
  const uint32_t silent_ticks = drive->order.tick - drive->heard_tick;
  if (drive->order.state == STATE_RUNNING && drive->order.state_ticks >= (uint32_t)drive->p->restart_clear_ticks) {
    renew_attempts(drive);
    drive->order.suspected = false;
  }
  return followed(drive, protect_step(&drive->protect, drive->p, in, &drive->order, &drive->settings, drive->report,
                                      by_vectors(drive) ? VECTOR_LOOK_TICKS : SIX_STEP_LOOK_TICKS, silent_ticks));
}

COLD static bool explains(const drive_t *drive, const chip_snapshot_t *in) {
  return by_vectors(drive) ? vector_explains(&drive->method.vector, in, &drive->order)
                           : six_step_explains(&drive->method.six_step, in, &drive->order);
}

INLINED static bool supervised(drive_t *drive, const chip_snapshot_t *in, const report_t *report) {
  const bool over_current = (in->trip_latched & TRIPS_OF_CURRENT) != 0u;
  const bool explained = __builtin_expect(over_current, 0) && explains(drive, in);
  return followed(drive, supervise_step(&drive->supervise, drive->p, in, &drive->order, report, explained));
}

// What is rare or slow before the method's own step. True: something has happened.
INLINED static bool judged(drive_t *drive, const chip_snapshot_t *in, const report_t *report, bool look,
                           bool protect) {
  if (__builtin_expect(drive->request != REQUEST_NONE, 0)) {
    follow_request(drive);
  }
  if (look && supervised(drive, in, report)) {
    return true;
  }
  return __builtin_expect(protect, 0) && followed_protection(drive, in);
}

INLINED static void begin_step(drive_t *drive) {
  order_t *order = &drive->order;
  order->tick++;
  order->state_ticks += (order->state_ticks < UINT32_MAX) ? 1u : 0u;
}

// The gates follow the method; while the drive runs they are on.
INLINED static void end_step(drive_t *drive, bool gates) {
  if (__builtin_expect(drive->order.state != STATE_RUNNING, 0) && gates != drive->guard.enable) {
    drive->guard.enable = gates;
    drive->guard.fresh = true;
  }
}

void drive_wait(drive_t *drive) { drive->order.tick++; }

INLINED void drive_vector_step(drive_t *drive, const chip_snapshot_t *in) {
  vector_t *method = &drive->method.vector;
  order_t *order = &drive->order;
  begin_step(drive);
  const bool look = vector_measure(method, in, order, &drive->settings);
  if (!judged(drive, in, &method->report, look,
              vector_turn_tick(method, order) % VECTOR_LOOK_TICKS == VECTOR_LOOK_AT)) {
    const bool init = __builtin_expect(order->state == STATE_INIT, 0);
    (void)followed(drive, init ? init_step(drive, in) : vector_step(method, in, order, &drive->settings));
  }
  vector_finish(method, order);
  end_step(drive, method->report.gates);
}

HOT void drive_step(drive_t *drive, const chip_snapshot_t *in) {
  six_step_t *method = &drive->method.six_step;
  order_t *order = &drive->order;
  begin_step(drive);
  order->settings_fresh = drive->settings_fresh;
  drive->settings_fresh = false;
  const bool look = six_step_measure(method, in, order, &drive->settings);
  if (!judged(drive, in, &method->report, look, order->tick % SIX_STEP_LOOK_TICKS == SIX_STEP_LOOK_AT)) {
    const bool init = __builtin_expect(order->state == STATE_INIT, 0);
    (void)followed(drive, init ? init_step(drive, in) : six_step_step(method, in, order, &drive->settings));
  }
  six_step_finish(method, order);
  end_step(drive, method->report.gates);
}
