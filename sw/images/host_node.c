// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "images/host_node.h"

#include <string.h>

#include "canopen/canopen.h"
#include "canopen/drive_link.h"
#include "canopen/flash_store.h"
#include "canopen/objects.h"
#include "hal/host/host_flash.h"
#include "images/host_main.h"
#include "ram.h"

static canopen_t node;

void fl_can_boot(uint32_t node_id, uint32_t now_us) {
  canopen_init(&node, fl_host_app(), flash_storage(), node_id, now_us);
}

void fl_can_setup_rate(uint32_t kbit_s) { node.bit_rate_kbit_s = kbit_s; }

void fl_can_receive(uint32_t id, uint32_t flags, uint32_t length, const uint8_t *data) {
  can_frame_t frame = {.id = id, .flags = (uint8_t)flags, .length = (uint8_t)length};
  memcpy(frame.data, data, (length < sizeof frame.data) ? length : sizeof frame.data);
  canopen_receive(&node, &frame);
}

void fl_can_step(uint32_t now_us) { canopen_step(&node, now_us); }

uint32_t fl_can_next(uint32_t *id, uint8_t *data) {
  can_frame_t frame;
  if (!canopen_next(&node, &frame)) {
    return HOST_NO_FRAME;
  }
  *id = frame.id;
  memcpy(data, frame.data, sizeof frame.data);
  return frame.length;
}

void fl_can_bus_off(void) { canopen_bus_off(&node); }
void fl_can_bus_back(void) { canopen_bus_back(&node); }
void fl_can_overrun(void) { canopen_overrun(&node); }

uint32_t fl_can_wanted(uint32_t k, uint32_t *mask) {
  const can_filter_t filter = canopen_wanted(&node, k);
  *mask = filter.mask;
  return filter.enable ? filter.id : UINT32_MAX;
}

uint32_t fl_can_value(uint32_t number) { return objects_read(&node, number); }

uint8_t *fl_can_memory(void) { return &fl_flash_contents()[FLASH_STORE - FLASH_BLOCK]; }
uint32_t fl_can_memory_bytes(void) { return STORE_SLOTS * FLASH_SECTOR_BYTES; }
