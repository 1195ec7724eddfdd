// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "canopen/cia402.h"

#include "canopen/canopen.h"
#include "control/fixed.h"
#include "control/placement.h"

SMALL_CODE_BEGIN

// Controlword.
#define CONTROL_SWITCH_ON 0x01u
#define CONTROL_VOLTAGE 0x02u
#define CONTROL_NO_QUICK_STOP 0x04u
#define CONTROL_ENABLE 0x08u
#define CONTROL_FAULT_RESET 0x80u
#define CONTROL_HALT 0x100u
// Statusword, beside the bits of the state.
#define STATUS_POWERED 0x0010u
#define STATUS_REMOTE 0x0200u
#define STATUS_REACHED 0x0400u
#define STATUS_LIMITED 0x0800u
#define STATUS_MODE 0x1000u  // profile velocity: stands still; cyclic modes: follows the target

// Longest time from one target of cyclic velocity to the next of the same line.
#define CYCLE_MAX_US 50000u

enum { REACT_NOTHING = 0, REACT_FAULT = 1, REACT_DISABLE = 2, REACT_QUICK_STOP = 3 };
// Values of the option codes; 5 and 6 of the quick stop stay in it.
enum { OPTION_OFF = 0, OPTION_SLOW = 1, OPTION_QUICK = 2, OPTION_SLOW_STAY = 5, OPTION_QUICK_STAY = 6 };

static int32_t value(const canopen_t *node, uint32_t number) { return (int32_t)node->value[number]; }

// The motor is driven, or will be from the next control tick on.
static bool is_active(const canopen_t *node) {
  const link_status_t *s = &node->drive.status;
  return s->state == STATE_STARTING || s->state == STATE_RUNNING || s->state == STATE_STOPPING ||
         s->request == REQUEST_START;
}

static void enter(canopen_t *node, pds_t state) {
  cia402_t *c = &node->drive;
  c->state = state;
  c->then = PDS_ENABLED;
  c->command.running = false;
  c->driving = false;
  c->stopped = false;
  if (state == PDS_ENABLED) {
    c->in_control = true;
    c->given = false;
    span_start(&c->command, node->now_us);
  }
}

void cia402_reset(canopen_t *node) {
  cia402_t *c = &node->drive;
  // What it had started is stopped by the steps to come.
  *c = (cia402_t){.state = PDS_NOT_READY, .then = PDS_ENABLED, .in_control = c->in_control};
  link_status(node->app, &c->status);
}

// Gates off, or a ramp before the state is left, as the option says.
static void leave(canopen_t *node, pds_t state, int32_t option) {
  if (option == OPTION_OFF || !is_active(node)) {
    enter(node, state);
  } else {
    node->drive.then = state;
  }
}

static void quick_stop(canopen_t *node) {
  if (value(node, OD_QUICK_STOP_OPTION) == OPTION_OFF) {
    enter(node, PDS_DISABLED);
  } else {
    enter(node, PDS_QUICK_STOP);
  }
}

static void fault(canopen_t *node, uint32_t code) {
  cia402_t *c = &node->drive;
  c->error_code = code;
  enter(node, PDS_FAULT_REACTION);
}

static void react(canopen_t *node, int32_t reaction, uint32_t code) {
  const pds_t state = node->drive.state;
  if (state != PDS_ENABLED && state != PDS_QUICK_STOP) {
    return;
  }
  if (reaction == REACT_FAULT) {
    fault(node, code);
  } else if (reaction == REACT_DISABLE) {
    enter(node, PDS_DISABLED);
  } else if (reaction == REACT_QUICK_STOP && state == PDS_ENABLED) {
    quick_stop(node);
  }
}

void cia402_connection_lost(canopen_t *node, uint32_t code) { react(node, value(node, OD_ABORT_CONNECTION_OPTION), code); }

// One transition by a controlword; true: the state has changed.
static bool transition(canopen_t *node, uint32_t word) {
  const pds_t state = node->drive.state;
  const bool voltage = (word & CONTROL_VOLTAGE) != 0u;
  const bool stop = voltage && (word & CONTROL_NO_QUICK_STOP) == 0u;
  const bool on = voltage && !stop && (word & CONTROL_SWITCH_ON) != 0u;
  const bool shut = voltage && !stop && !on;
  const bool enable = on && (word & CONTROL_ENABLE) != 0u;
  switch (state) {
    case PDS_DISABLED:
      if (shut) {
        enter(node, PDS_READY);
      }
      break;
    case PDS_READY:
      if (!voltage || stop) {
        enter(node, PDS_DISABLED);
      } else if (on) {
        enter(node, PDS_SWITCHED_ON);
      }
      break;
    case PDS_SWITCHED_ON:
      if (!voltage || stop) {
        enter(node, PDS_DISABLED);
      } else if (shut) {
        enter(node, PDS_READY);
      } else if (enable) {
        enter(node, PDS_ENABLED);
      }
      break;
    case PDS_ENABLED:
      if (!voltage) {
        enter(node, PDS_DISABLED);
      } else if (stop) {
        quick_stop(node);
      } else if (shut) {
        leave(node, PDS_READY, value(node, OD_SHUTDOWN_OPTION));
      } else if (!enable) {
        leave(node, PDS_SWITCHED_ON, value(node, OD_DISABLE_OPERATION_OPTION));
      } else {
        node->drive.then = PDS_ENABLED;
      }
      break;
    case PDS_QUICK_STOP:
      if (!voltage) {
        enter(node, PDS_DISABLED);
      } else if (enable && value(node, OD_QUICK_STOP_OPTION) >= OPTION_SLOW_STAY) {
        enter(node, PDS_ENABLED);
      }
      break;
    default:
      break;
  }
  return node->drive.state != state;
}

void cia402_control(canopen_t *node, uint32_t word) {
  cia402_t *c = &node->drive;
  const bool reset = (word & ~c->controlword & CONTROL_FAULT_RESET) != 0u;
  c->controlword = word;
  if (c->state == PDS_FAULT) {
    if (reset) {
      c->clearing = true;
      if (c->status.state == STATE_FAULT) {
        link_request(node->app, REQUEST_CLEAR);
      }
    }
    return;
  }
  // Enable operation in ready to switch on makes two transitions.
  while (transition(node, word)) {
  }
}

static int32_t limit_permille(const canopen_t *node) {
  const int32_t current = value(node, OD_MAX_CURRENT);
  const int32_t torque = value(node, OD_MAX_TORQUE);
  const int32_t lower = (current < torque) ? current : torque;
  return (lower < 1000) ? lower : 1000;
}

// Part of the rated current; 0.1 % of it is within 31 bits up to 21 kA.
static int32_t rated_part_ma(const canopen_t *node, int32_t permille) {
  return value(node, OD_RATED_CURRENT) / 10 * permille / 100;
}

// The drive's lowest limit is above zero.
static int32_t limit_ma(const canopen_t *node) {
  const int32_t part = rated_part_ma(node, limit_permille(node));
  return (part < 1) ? 1 : part;
}

// A target that the master moves each cycle is a line: the ramp takes the time to it that the master took. A target that
// comes alone, and one that is too far, have the ramp of the object.
static void follow_line(canopen_t *node, link_order_t *order) {
  cia402_t *c = &node->drive;
  if (!c->order.line || order->target_rpm != c->order.target_rpm) {
    const uint32_t took_us = node->now_us - c->point_us;
    c->point_us = node->now_us;
    c->line_rpm_s = UINT32_MAX;
    if (c->order.line && took_us > 0u && took_us <= CYCLE_MAX_US) {
      const uint32_t way_rpm = (uint32_t)abs_sat(order->target_rpm - c->status.demand_rpm);
      c->line_rpm_s = div_sat_u32((uint64_t)way_rpm * 1000000u, took_us);
    }
  }
  if (c->line_rpm_s < (uint32_t)order->accel_rpm_s) {
    order->accel_rpm_s = (c->line_rpm_s > 0u) ? (int32_t)c->line_rpm_s : 1;
  }
}

// Speed, current and ramp of what is wanted, 0 in both: stand still. True: a limit of the profile bound.
static bool wanted(canopen_t *node, link_order_t *order) {
  const int32_t mode = value(node, OD_MODES_OF_OPERATION_DISPLAY);
  const int32_t motor = value(node, OD_MAX_MOTOR_SPEED);
  const int32_t profile = value(node, OD_MAX_PROFILE_VELOCITY);
  const int32_t fastest = (profile < motor) ? profile : motor;
  const int32_t permille = limit_permille(node);
  order->limit_ma = limit_ma(node);
  if (mode == OPERATION_TORQUE) {
    const int32_t torque = value(node, OD_TARGET_TORQUE);
    const int32_t bound = clamp_i32(torque, -permille, permille);
    order->torque = true;
    order->current_ma = rated_part_ma(node, bound);
    order->target_rpm = (bound == 0) ? 0 : fastest;
    order->accel_rpm_s = value(node, OD_MAX_ACCELERATION);
    return bound != torque;
  }
  if (mode != OPERATION_PROFILE_VELOCITY && mode != OPERATION_VELOCITY) {
    order->target_rpm = 0;
    order->accel_rpm_s = value(node, OD_PROFILE_DECELERATION);
    return false;
  }
  const int32_t target = value(node, OD_TARGET_VELOCITY);
  const int32_t demand = node->drive.status.demand_rpm;
  order->target_rpm = clamp_i32(target, -fastest, fastest);
  const bool cyclic = mode == OPERATION_VELOCITY;
  const bool slower = (demand > 0 && order->target_rpm < demand) || (demand < 0 && order->target_rpm > demand);
  const uint32_t number = cyclic ? (slower ? OD_MAX_DECELERATION : OD_MAX_ACCELERATION)
                                 : (slower ? OD_PROFILE_DECELERATION : OD_PROFILE_ACCELERATION);
  order->accel_rpm_s = value(node, number);
  order->line = cyclic;
  if (cyclic) {
    follow_line(node, order);
  }
  link_ratings_t ratings;
  link_ratings(node->app, &ratings);
  return order->target_rpm != target || (target != 0 && abs_sat(target) < ratings.stop_rpm);
}

static void give(canopen_t *node, const link_order_t *order) {
  link_order_t *last = &node->drive.order;
  if (!node->drive.given || order->target_rpm != last->target_rpm || order->accel_rpm_s != last->accel_rpm_s ||
      order->limit_ma != last->limit_ma || order->line != last->line || order->torque != last->torque || order->current_ma != last->current_ma) {
    *last = *order;
    node->drive.given = true;
    link_order(node->app, order);
  }
}

// By the ramp to standstill; true: it stands with the gates off.
static bool stop_by_ramp(canopen_t *node, uint32_t ramp) {
  cia402_t *c = &node->drive;
  c->driving = false;
  if (!is_active(node)) {
    return true;
  }
  const link_order_t order = {
      .target_rpm = c->order.target_rpm, .accel_rpm_s = value(node, ramp), .limit_ma = limit_ma(node)};
  give(node, &order);
  if (c->status.state != STATE_STOPPING) {
    link_request(node->app, REQUEST_STOP);
  }
  return false;
}

static bool stop_by_option(canopen_t *node, int32_t option) {
  if (option == OPTION_OFF) {
    node->drive.driving = false;
    if (is_active(node)) {
      link_request(node->app, REQUEST_STOP_NOW);
    }
    return !is_active(node);
  }
  const bool slow = option == OPTION_SLOW || option == OPTION_SLOW_STAY;
  return stop_by_ramp(node, slow ? OD_PROFILE_DECELERATION : OD_QUICK_STOP_DECELERATION);
}

// About the least speed of the drive, or slower.
static bool is_slow(const canopen_t *node) {
  link_ratings_t ratings;
  link_ratings(node->app, &ratings);
  return abs_sat(node->drive.status.speed_rpm) <= ratings.stop_rpm + ratings.stop_rpm / 4;
}

// The current is given in the direction of the rotor. A torque against it brakes, and turns the drive at its least speed.
static void direct_torque(canopen_t *node, link_order_t *order) {
  cia402_t *c = &node->drive;
  if (!is_active(node) || (c->status.state == STATE_RUNNING && is_slow(node))) {
    c->backward = order->current_ma < 0;
  }
  if (c->backward) {
    order->target_rpm = -order->target_rpm;
    order->current_ma = -order->current_ma;
  }
}

static bool run(canopen_t *node) {
  cia402_t *c = &node->drive;
  link_order_t order = {0};
  const bool limited = wanted(node, &order);
  if (order.target_rpm == 0) {
    // A torque of 0 lets the rotor slow down by itself.
    if (order.torque && c->status.state == STATE_RUNNING && !is_slow(node)) {
      order.target_rpm = c->order.target_rpm;
      give(node, &order);
    } else {
      const bool cyclic = value(node, OD_MODES_OF_OPERATION_DISPLAY) == OPERATION_VELOCITY;
      (void)stop_by_ramp(node, cyclic ? OD_MAX_DECELERATION : OD_PROFILE_DECELERATION);
    }
    return limited;
  }
  if (order.torque) {
    direct_torque(node, &order);
  }
  give(node, &order);
  const bool ready = c->status.state == STATE_READY;
  if (ready) {
    link_request(node->app, REQUEST_START);
  }
  c->driving = c->driving || ready || (c->status.state != STATE_STOPPING && c->status.request == REQUEST_NONE);
  return limited;
}

// What the state asks of the motor. True: a limit of the profile bound.
static bool move(canopen_t *node) {
  cia402_t *c = &node->drive;
  bool limited = false;
  switch (c->state) {
    case PDS_ENABLED:
      if (c->stopped) {
        break;
      }
      if (c->then != PDS_ENABLED) {
        if (stop_by_option(node, OPTION_SLOW)) {
          enter(node, c->then);
        }
      } else if ((c->controlword & CONTROL_HALT) != 0u) {
        (void)stop_by_option(node, value(node, OD_HALT_OPTION));
      } else {
        limited = run(node);
      }
      break;
    case PDS_QUICK_STOP:
      if (stop_by_option(node, value(node, OD_QUICK_STOP_OPTION)) &&
          value(node, OD_QUICK_STOP_OPTION) < OPTION_SLOW_STAY) {
        enter(node, PDS_DISABLED);
      }
      break;
    case PDS_FAULT_REACTION:
      if (stop_by_option(node, value(node, OD_FAULT_REACTION_OPTION))) {
        enter(node, PDS_FAULT);
      }
      break;
    default:
      // A motor that the console has started is left alone.
      if (c->in_control) {
        c->in_control = !stop_by_option(node, OPTION_OFF);
      }
      break;
  }
  return limited;
}

// Faults of the drive, and the way out of them: it goes through init to ready.
static void follow_faults(canopen_t *node) {
  cia402_t *c = &node->drive;
  const bool dead = c->status.state == STATE_INIT && c->status.fault != FAULT_NONE && !c->clearing;
  if (c->status.state == STATE_FAULT || dead) {
    const uint32_t number = (uint32_t)c->status.fault;
    if (c->state != PDS_FAULT) {
      enter(node, PDS_FAULT);
    }
    c->error_code = emcy_code(number);
    emcy_set_drive(node, number);
    // Taken, and the fault has come again.
    c->clearing = c->clearing && c->status.request == REQUEST_CLEAR;
    return;
  }
  // The console has cleared it: over, though the master has not reset the operation yet.
  if (!c->clearing) {
    emcy_clear(node, EMCY_DRIVE);
  }
  if (c->state == PDS_NOT_READY && c->status.state != STATE_INIT) {
    enter(node, PDS_DISABLED);
  }
  // Nothing runs with settings that nobody has chosen.
  const bool lost = node->store.state == STORE_LOST;
  if (lost && c->state != PDS_NOT_READY && c->state != PDS_FAULT_REACTION && c->state != PDS_FAULT) {
    fault(node, emcy_cause_code(EMCY_STORE_LOST));
  }
  if (c->state == PDS_FAULT && c->clearing && c->status.state == STATE_READY) {
    c->clearing = false;
    c->error_code = lost ? emcy_cause_code(EMCY_STORE_LOST) : 0u;
    emcy_clear(node, EMCY_DRIVE);
    emcy_clear(node, EMCY_COMMAND_TIMEOUT);
    emcy_clear(node, EMCY_BUS_OFF);
    if (!lost) {
      enter(node, PDS_DISABLED);
    }
  }
}

// A stop that is not the master's, from the console, ends the operation: the master enables it anew.
static void follow_stops(canopen_t *node) {
  cia402_t *c = &node->drive;
  const bool active = is_active(node);
  if (c->driving && (!active || c->status.state == STATE_STOPPING)) {
    c->stopped = true;
  }
  if (c->stopped && !active) {
    enter(node, PDS_DISABLED);
  }
}

static void watch_command(canopen_t *node) {
  cia402_t *c = &node->drive;
  const uint32_t time_us = node->value[OD_COMMAND_TIMEOUT_TIME] * 1000u;
  const uint32_t heard_tick = node->app->drive.heard_tick;
  // Of a command, or of the console.
  if (heard_tick != c->heard_tick) {
    c->heard_tick = heard_tick;
    span_start(&c->command, node->now_us);
    emcy_clear(node, EMCY_COMMAND_TIMEOUT);
  }
  if (c->state != PDS_ENABLED || time_us == 0u) {
    return;
  }
  if (span_over(&c->command, node->now_us, time_us)) {
    emcy_set(node, EMCY_COMMAND_TIMEOUT, 0);
    react(node, value(node, OD_COMMAND_TIMEOUT_REACTION), emcy_cause_code(EMCY_COMMAND_TIMEOUT));
  }
}

// True for as long as the condition has held for the time.
static void hold(canopen_t *node, bool condition, uint32_t time_ms, span_t *span, bool *held) {
  if (!condition) {
    span->running = false;
    *held = false;
  } else if (!*held && !span->running) {
    span_start(span, node->now_us);
  }
  if (condition && span_over(span, node->now_us, time_ms * 1000u)) {
    *held = true;
  }
}

static uint32_t state_bits(pds_t state) {
  static const uint16_t bits[] = {
      [PDS_NOT_READY] = 0x0000,   [PDS_DISABLED] = 0x0040,       [PDS_READY] = 0x0021, [PDS_SWITCHED_ON] = 0x0023,
      [PDS_ENABLED] = 0x0027,     [PDS_QUICK_STOP] = 0x0007,     [PDS_FAULT_REACTION] = 0x000F,
      [PDS_FAULT] = 0x0008,
  };
  return bits[state];
}

static void show(canopen_t *node, bool limited) {
  cia402_t *c = &node->drive;
  const link_status_t *s = &c->status;
  const int32_t mode = value(node, OD_MODES_OF_OPERATION_DISPLAY);
  const int32_t rated_ma = value(node, OD_RATED_CURRENT);
  const int32_t halted = (c->controlword & CONTROL_HALT) != 0u ? 0 : value(node, OD_TARGET_VELOCITY);
  const uint32_t apart_rpm = (uint32_t)abs_sat(sat_i32((int64_t)s->speed_rpm - halted));
  const bool enabled = c->state == PDS_ENABLED;
  hold(node, enabled && mode != OPERATION_TORQUE && apart_rpm <= node->value[OD_VELOCITY_WINDOW],
       node->value[OD_VELOCITY_WINDOW_TIME], &c->reaching, &c->reached);
  hold(node, (uint32_t)abs_sat(s->speed_rpm) <= node->value[OD_VELOCITY_THRESHOLD],
       node->value[OD_VELOCITY_THRESHOLD_TIME], &c->standing, &c->still);
  const bool follows = enabled && s->state == STATE_RUNNING && !limited;
  const bool mode_bit = (mode == OPERATION_PROFILE_VELOCITY) ? c->still : (mode != OPERATION_NONE && follows);
  node->value[OD_STATUSWORD] = state_bits(c->state) | STATUS_REMOTE | (s->powered ? STATUS_POWERED : 0u) |
                               (c->reached ? STATUS_REACHED : 0u) | ((limited || s->limited) ? STATUS_LIMITED : 0u) |
                               (mode_bit ? STATUS_MODE : 0u);
  node->value[OD_ERROR_CODE] = c->error_code;
  node->value[OD_VELOCITY_ACTUAL] = (uint32_t)s->speed_rpm;
  node->value[OD_VELOCITY_DEMAND] = (uint32_t)s->demand_rpm;
  node->value[OD_DC_LINK_VOLTAGE] = (uint32_t)((s->vdc_mv > 0) ? s->vdc_mv : 0);
  const uint64_t size = (uint64_t)(uint32_t)abs_sat(s->current_ma) * 1000u;
  const uint32_t permille = (rated_ma > 0) ? clamp_u32(div_sat_u32(size, (uint32_t)rated_ma), 0, 32767u) : 0u;
  const uint32_t current = (s->current_ma < 0) ? 0u - permille : permille;
  node->value[OD_CURRENT_ACTUAL] = current;
  node->value[OD_TORQUE_ACTUAL] = current;
  node->value[OD_TORQUE_DEMAND] = (enabled && mode == OPERATION_TORQUE) ? node->value[OD_TARGET_TORQUE] : 0u;
}

void cia402_step(canopen_t *node) {
  cia402_t *c = &node->drive;
  link_status(node->app, &c->status);
  node->value[OD_MODES_OF_OPERATION_DISPLAY] = node->value[OD_MODES_OF_OPERATION];
  follow_faults(node);
  follow_stops(node);
  watch_command(node);
  const bool limited = move(node);
  show(node, limited);
}

SMALL_CODE_END
