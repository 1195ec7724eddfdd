// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// A CANopen node (CiA 301) with the drive profile CiA 402 on the drive of sw/drive.
//
// No heap, no interrupt of its own: canopen_receive, canopen_step and canopen_next are called from one place, the main
// loop or a deferred interrupt. The driver hands over received frames in their order and takes frames to send; the
// time is a wrapping counter of microseconds. A step without work takes some hundred clocks.
#ifndef FL_CANOPEN_H
#define FL_CANOPEN_H

#include <stdbool.h>
#include <stdint.h>

#include "app/app.h"
#include "canopen/cia402.h"
#include "canopen/dictionary.h"
#include "canopen/emcy.h"
#include "canopen/nmt.h"
#include "canopen/pdo.h"
#include "canopen/sdo.h"
#include "canopen/send_queue.h"
#include "canopen/store.h"
#include "hal/can.h"

typedef struct canopen {
  app_t *app;
  const storage_t *storage;  // 0: nothing can be stored
  uint32_t node_id;          // 1..127
  uint32_t bit_rate_kbit_s;  // of the driver
  uint32_t resets;           // of the whole node; wraps. The driver takes the bit rate over when it changes
  bool wanted_fresh;         // canopen_wanted has changed; the driver clears it
  bool written;              // an object has been, a step is due; the driver clears it
  uint32_t now_us;
  uint32_t value[OD_COUNT];  // two's complement, extended to 32 bits
  uint8_t label[OD_STRING_MAX];
  uint32_t label_length;
  store_t store;
  send_queue_t queue;
  nmt_t nmt;
  sdo_t sdo;
  pdo_t pdo;
  emcy_t emcy;
  cia402_t drive;
} canopen_t;

// Defaults, then what is stored; the boot-up frame is the first one to send. The application must have booted.
// node_id: for a device that has stored none.
void canopen_init(canopen_t *node, app_t *app, const storage_t *storage, uint32_t node_id, uint32_t now_us);
// The k-th set of frames that the node receives, k < CAN_FILTERS: for the filters of a controller.
can_filter_t canopen_wanted(const canopen_t *node, uint32_t k);
// A frame from the bus, whatever it is.
void canopen_receive(canopen_t *node, const can_frame_t *frame);
// Timers, drive profile, TPDOs. At least once a millisecond for times to hold to a millisecond.
void canopen_step(canopen_t *node, uint32_t now_us);
// Next frame to send; false: none.
bool canopen_next(canopen_t *node, can_frame_t *frame);
// The controller has gone bus-off, and has come back.
void canopen_bus_off(canopen_t *node);
void canopen_bus_back(canopen_t *node);
// The controller has lost frames: its FIFO was full.
void canopen_overrun(canopen_t *node);

// Shared by the parts of the node.
bool canopen_send(canopen_t *node, uint32_t id, const uint8_t *data, uint32_t length, bool is_pdo);

#endif
