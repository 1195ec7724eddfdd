// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// What the CANopen node wants of the drive, in units of people: the only part of it that knows sw/drive.
//
// Called from where the console is called from; settings change as a whole between two control ticks.
#ifndef FL_DRIVE_LINK_H
#define FL_DRIVE_LINK_H

#include <stdbool.h>
#include <stdint.h>

#include "app/app.h"

// As of the last control tick. Signs: positive is forward.
typedef struct {
  drive_state_t state;
  fault_t fault;
  request_t request;  // that waits for the control tick
  bool powered;  // the DC link is above its minimum
  bool limited;  // a limit bound the voltage
  int32_t speed_rpm;
  int32_t demand_rpm;  // of the ramp
  int32_t current_ma;  // that makes torque
  int32_t vdc_mv;
} link_status_t;

// Fixed after boot; zero without valid parameters.
typedef struct {
  int32_t rated_ma;  // the current limit of the parameter block
  int32_t rated_mnm;
  int32_t speed_max_rpm;
  int32_t stop_rpm;  // least speed
  int32_t accel_rpm_s;
  bool torque;  // the method has a torque mode
} link_ratings_t;

typedef struct {
  int32_t target_rpm;  // torque mode: limit of the speed, its sign the direction
  int32_t accel_rpm_s;
  int32_t limit_ma;
  bool line;  // the target is a point of a line that goes on
  bool torque;
  int32_t current_ma;  // torque mode; positive drives in the direction of target_rpm
} link_order_t;

void link_status(const app_t *app, link_status_t *status);
void link_ratings(const app_t *app, link_ratings_t *ratings);
// Whether the torque mode is there now: the current loop is on.
bool link_has_torque(const app_t *app);
// Values beyond the drive's range leave the settings as they were.
void link_order(app_t *app, const link_order_t *order);
// A start or stop gives way to a request that waits for the control tick; stop now and clear replace it.
void link_request(app_t *app, request_t request);

// Objects that are marked live in the dictionary, by number; false: refused.
uint32_t link_read(const app_t *app, uint32_t number);
bool link_write(app_t *app, uint32_t number, uint32_t value);
// Tables of the wiring's test, as wiring_t begins; 0: it has not ended.
const uint8_t *link_wiring(const app_t *app);

#endif
