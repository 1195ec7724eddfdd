// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "canopen/chip_node.h"

#include "canopen/canopen.h"
#include "canopen/flash_store.h"
#include "hal/can.h"
#include "hal/can_setup.h"
#include "hal/chip.h"
#include "hal/cpu.h"
#include "hal/flash.h"

// That wait are taken together, before the console has its turn again.
#define FRAMES_A_ROUND 4u
// Between two steps of the node while no object is written.
#define STEP_US 500u

static canopen_t node;

static struct {
  uint32_t slot[STORE_SLOTS][STORE_WORDS];
} memory;

static struct {
  app_t *app;
  uint32_t clocks_us;  // clocks a microsecond
  uint32_t then;       // clock up to which now_us counts
  uint32_t now_us;
  uint32_t stepped_us;
  uint32_t resets;  // of the node, as far as taken over
  bool absent;      // without a node-ID: nothing is sent
  bool bus_off;
  bool waits;  // `next` is a frame that had no room
  can_frame_t next;
} driver;

static bool memory_read(void *context, uint32_t slot, void *data, uint32_t bytes) {
  (void)context;
  uint32_t *to = data;
  for (uint32_t i = 0; i < bytes / 4u; i++) {
    to[i] = memory.slot[slot][i];
  }
  return true;
}

static bool memory_write(void *context, uint32_t slot, const void *data, uint32_t bytes) {
  (void)context;
  const uint32_t *from = data;
  for (uint32_t i = 0; i < bytes / 4u; i++) {
    memory.slot[slot][i] = from[i];
  }
  return true;
}

static const storage_t volatile_storage = {.read = memory_read, .write = memory_write};

static void join(void) {
  can_join(can_bit_timing(chip_clock_hz(), node.value[OD_DEVICE_BIT_RATE]));
  driver.resets = node.resets;
}

static void set_filters(void) {
  for (uint32_t k = 0; k < CAN_FILTERS; k++) {
    const can_filter_t filter = canopen_wanted(&node, k);
    can_set_filter(k, &filter);
  }
  node.wanted_fresh = false;
}

void chip_node_init(app_t *app) {
  const storage_t *flash = flash_storage();
  uint32_t *setup = cpu_can_setup();
  driver.app = app;
  // What the flash holds stays in the RAM: for a restart that gets no answer.
  const bool known = flash == 0 || flash_can_setup(setup) || (!flash_answers() && setup[0] != 0u);
  driver.clocks_us = chip_clock_hz() / 1000000u;
  driver.then = chip_now();
  // Where it is broken the node takes the ID and the rate that it has stored, and says so.
  node.bit_rate_kbit_s = known ? setup[1] : UINT32_MAX;
  canopen_init(&node, app, (flash != 0) ? flash : &volatile_storage, known ? setup[0] : 0u, driver.now_us);
  driver.absent = node.node_id == 0u;
  if (driver.absent) {
    return;
  }
  set_filters();
  join();
}

static void tell_time(void) {
  const uint32_t passed_us = (chip_now() - driver.then) / driver.clocks_us;
  driver.then += passed_us * driver.clocks_us;
  driver.now_us += passed_us;
}

static void tell_state(void) {
  const bool off = can_is_bus_off();
  if (off && !driver.bus_off) {
    canopen_bus_off(&node);
  } else if (!off && driver.bus_off) {
    canopen_bus_back(&node);
  }
  driver.bus_off = off;
}

static void send(void) {
  if (!driver.waits) {
    driver.waits = canopen_next(&node, &driver.next);
  }
  while (driver.waits && can_send(&driver.next)) {
    driver.waits = canopen_next(&node, &driver.next);
  }
}

// True: a frame came.
static bool poll(void) {
  can_frame_t frame;
  bool lost = false;
  tell_time();
  const bool came = can_take(&frame, &lost);
  if (lost) {
    canopen_overrun(&node);
  }
  if (came) {
    canopen_receive(&node, &frame);
  }
  // A frame that is read, refused or passed over leaves the time to those behind it.
  if (node.written || driver.now_us - driver.stepped_us >= STEP_US) {
    node.written = false;
    driver.stepped_us = driver.now_us;
    tell_state();
    canopen_step(&node, driver.now_us);
  }
  send();
  if (node.resets != driver.resets) {
    join();
  }
  if (node.wanted_fresh) {
    set_filters();
  }
  return came;
}

void chip_node_poll(void) {
  const work_t before = app_begin(driver.app, WORK_NODE);
  for (uint32_t k = 0; !driver.absent && k < FRAMES_A_ROUND && poll(); k++) {
  }
  app_done(driver.app, WORK_NODE, before);
}
