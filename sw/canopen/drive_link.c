// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "canopen/drive_link.h"

#include "app/crash.h"
#include "canopen/dictionary.h"
#include "control/fixed.h"
#include "control/placement.h"
#include "hal/capture.h"
#include "hal/cpu.h"

SMALL_CODE_BEGIN

// value / 2^bits of a full scale, in thousandths of its unit.
static int32_t milli(int32_t value, int32_t full_scale_milli, int32_t bits) {
  return sat_i32(round_shift((int64_t)value * full_scale_milli, bits));
}

void link_status(const app_t *app, link_status_t *status) {
  const drive_t *d = &app->drive;
  const parameters_t *p = d->p;
  *status = (link_status_t){.state = d->order.state, .fault = d->fault, .request = d->request};
  if (p == 0) {
    return;
  }
  bool turned;
  int32_t speed_rpm_q8;
  int32_t demand_rpm_q8;
  int32_t current_q17;
  int32_t vdc_v_q25;
  limit_t limit;
  uint32_t tick;
  // One coherent set without holding the control step off: where it came in between, read again.
  do {
    tick = *(const volatile uint32_t *)&d->order.tick;
    __atomic_signal_fence(__ATOMIC_SEQ_CST);
    turned = d->report->backward;
    speed_rpm_q8 = d->report->speed_rpm_q8;
    demand_rpm_q8 = d->report->demand_rpm_q8;
    current_q17 = d->report->current_i_q25 / 256;
    vdc_v_q25 = d->report->vdc_v_q25;
    limit = d->report->limit;
    status->state = d->order.state;
    status->fault = d->fault;
    status->request = d->request;
    __atomic_signal_fence(__ATOMIC_SEQ_CST);
  } while (*(const volatile uint32_t *)&d->order.tick != tick);
  const bool active = status->state == STATE_RUNNING || status->state == STATE_STOPPING;
  status->limited = active && limit != LIMIT_NONE;
  status->vdc_mv = milli(vdc_v_q25, p->voltage_full_scale_mv, 25);
  status->powered = vdc_v_q25 / 256 >= p->vdc_min_q17;
  if (active) {
    status->speed_rpm = (turned ? -speed_rpm_q8 : speed_rpm_q8) / 256;
    status->demand_rpm = (turned ? -demand_rpm_q8 : demand_rpm_q8) / 256;
    status->current_ma = milli(turned ? -current_q17 : current_q17, p->current_full_scale_ma, 17);
  }
}

void link_ratings(const app_t *app, link_ratings_t *ratings) {
  const parameters_t *p = app->drive.p;
  *ratings = (link_ratings_t){0};
  if (p == 0) {
    return;
  }
  const int32_t rated_i_q25 = current_q17_of_ma(p, p->current_limit_ma) * 256;
  ratings->rated_ma = p->current_limit_ma;
  ratings->rated_mnm = (torque_unm_of_current(p, rated_i_q25) + 500) / 1000;
  ratings->speed_max_rpm = p->speed_max_rpm;
  ratings->stop_rpm = p->stop_rpm;
  ratings->accel_rpm_s = p->accel_rpm_s;
  ratings->torque = method_is_six_step(p->method);
}

bool link_has_torque(const app_t *app) {
  const drive_t *d = &app->drive;
  return d->p != 0 && method_is_six_step(d->p->method) && d->settings.current_loop;
}

void link_order(app_t *app, const link_order_t *order) {
  const parameters_t *p = app->drive.p;
  if (p == 0) {
    return;
  }
  settings_t next = app->drive.settings;
  if (settings_set(&next, p, SETTING_SPEED_RPM, order->target_rpm) != SETTING_TAKEN ||
      settings_set(&next, p, SETTING_ACCEL_RPM_S, order->accel_rpm_s) != SETTING_TAKEN ||
      (order->torque && settings_set(&next, p, SETTING_CURRENT_MA, order->current_ma) != SETTING_TAKEN)) {
    return;
  }
  const int32_t limit_q17 = current_q17_of_ma(p, order->limit_ma);
  next.line = order->line;
  next.current_limit_q17 = limit_q17;
  next.mode = order->torque ? MODE_TORQUE : MODE_SPEED;
  const uint32_t state = critical_enter();
  drive_order(&app->drive, &next);
  critical_leave(state);
}

void link_request(app_t *app, request_t request) {
  const uint32_t state = critical_enter();
  if (app->drive.request == REQUEST_NONE || request == REQUEST_STOP_NOW || request == REQUEST_CLEAR) {
    drive_request(&app->drive, request);
  }
  critical_leave(state);
}

// Entries of the fault log, the newest is 0.
static fault_entry_t logged(const drive_t *d, uint32_t back) {
  const fault_entry_t none = {FAULT_NONE, 0};
  const uint32_t count = d->log.count;
  return (back < count) ? d->log.entry[(count - 1u - back) % FAULT_LOG_LENGTH] : none;
}

// Setting of an object.
static setting_t setting_of(uint32_t number) {
  static const uint8_t settings[] = OD_SETTINGS;
  return (setting_t)settings[number - OD_SETTINGS_FIRST];
}

uint32_t link_read(const app_t *app, uint32_t number) {
  const drive_t *d = &app->drive;
  const parameters_t *p = d->p;
  if (number >= OD_FAULT_NUMBER_1 && number <= OD_FAULT_NUMBER_8) {
    return (uint32_t)logged(d, number - OD_FAULT_NUMBER_1).fault;
  }
  if (number >= OD_FAULT_TICK_1 && number <= OD_FAULT_TICK_8) {
    return logged(d, number - OD_FAULT_TICK_1).tick;
  }
  if (number == OD_FAULT_PRESENT) {
    return (uint32_t)d->fault;
  }
  if (number == OD_FAULT_TOTAL) {
    return d->log.count;
  }
  if (number >= OD_RESTART_NUMBER && number <= OD_RESTART_VALUE) {
    const crash_t crash = crash_seen();
    return (&crash.count)[number - OD_RESTART_NUMBER];
  }
  if (number == OD_RESTART_STACK) {
    return cpu_stack_bytes();
  }
  if (p == 0) {
    return 0;
  }
  if (number >= OD_SETTINGS_FIRST && number < OD_SETTINGS_END) {
    return (uint32_t)settings_get(&d->settings, p, setting_of(number));
  }
  if (number >= OD_THRESHOLD_SECTOR_1 && number <= OD_THRESHOLD_SECTOR_6) {
    return (uint32_t)d->report->six_step.threshold_q17[number - OD_THRESHOLD_SECTOR_1];
  }
  switch (number) {
    case OD_OBSERVER_I_D:
      return (uint32_t)milli(d->report->vector.current_i_q17.re, p->current_full_scale_ma, 17);
    case OD_OBSERVER_I_Q:
      return (uint32_t)milli(d->report->vector.current_i_q17.im, p->current_full_scale_ma, 17);
    case OD_OBSERVER_ANGLE:
      return d->report->vector.angle_turn_q32;
    case OD_OBSERVER_CROSSINGS:
      return d->report->crossings;
    case OD_OBSERVER_LOST_LOCKS:
      return d->lost_locks;
    case OD_OBSERVER_CATCHES:
      return d->report->catches;
    case OD_OBSERVER_COMMUTATED_BY:
      return d->report->six_step.commutated_by;
    case OD_CAPTURE_CONTROL:
      return capture_control();
    case OD_CAPTURE_LANES:
      return capture_lanes();
    case OD_CAPTURE_STATUS:
      return capture_status();
    default:
      return 0;
  }
}

const uint8_t *link_wiring(const app_t *app) {
  const wiring_t *seen = (app->drive.p == 0) ? 0 : app->drive.report->wiring;
  return (seen != 0 && seen->known) ? (const uint8_t *)seen : 0;
}

bool link_write(app_t *app, uint32_t number, uint32_t value) {
  if (app->drive.p == 0) {
    return false;
  }
  if (number == OD_CAPTURE_CONTROL) {
    capture_configure(value);
    return true;
  }
  if (number == OD_CAPTURE_LANES) {
    capture_set_lanes(value);
    return true;
  }
  return app_set(app, setting_of(number), (int32_t)value) == SETTING_TAKEN;
}

SMALL_CODE_END
