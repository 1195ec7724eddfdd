// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Drive profile CiA 402: state machine of controlword and statusword, profile velocity, cyclic synchronous velocity and
// torque, limits, quick stop, reactions to faults and to a lost master.
//
// "Operation enabled" with the target 0 leaves the gates off: a sensorless drive holds no torque at standstill. A target
// starts the motor, 0 stops it by the ramp. A target of the other sign goes through standstill.
#ifndef FL_CIA402_H
#define FL_CIA402_H

#include <stdbool.h>
#include <stdint.h>

#include "canopen/drive_link.h"
#include "canopen/timer.h"

typedef struct canopen canopen_t;

typedef enum {
  PDS_NOT_READY,
  PDS_DISABLED,
  PDS_READY,
  PDS_SWITCHED_ON,
  PDS_ENABLED,
  PDS_QUICK_STOP,
  PDS_FAULT_REACTION,
  PDS_FAULT,
} pds_t;

enum { OPERATION_NONE = 0, OPERATION_PROFILE_VELOCITY = 3, OPERATION_VELOCITY = 9, OPERATION_TORQUE = 10 };

typedef struct {
  pds_t state;
  pds_t then;          // state after the ramp that runs; PDS_ENABLED: no such ramp
  uint32_t controlword;
  bool in_control;     // the node has started the motor, or is to stop it
  bool clearing;       // a fault reset is on its way through the drive
  bool driving;        // the operation has the motor on, or has asked for it
  bool stopped;        // by somebody else since
  bool backward;       // torque mode: direction of the rotor
  uint32_t error_code;
  link_status_t status;
  bool given;          // an order, since the operation was enabled
  link_order_t order;  // the last one
  uint32_t point_us;   // of the last target of cyclic velocity
  uint32_t line_rpm_s;  // slope to it
  uint32_t heard_tick;  // at which the drive last heard of master or console
  span_t command;      // since the last command
  span_t reaching;     // target within its window
  span_t standing;
  bool reached;
  bool still;
} cia402_t;

void cia402_reset(canopen_t *node);
// A controlword has come.
void cia402_control(canopen_t *node, uint32_t word);
// The master is lost; code: EMCY code of why. What happens is 0x6007's.
void cia402_connection_lost(canopen_t *node, uint32_t code);
void cia402_step(canopen_t *node);

#endif
