// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "canopen/canopen.h"

#include "canopen/drive_link.h"
#include "canopen/objects.h"

// Indices of what a reset takes anew.
#define LAST_INDEX 0xFFFFu
#define LAST_COMMUNICATION 0x1FFFu

// NMT reset of the node, or of communication only (objects below 0x2000): values anew, boot-up frame.
static void reset(canopen_t *node, bool whole) {
  const uint32_t last = whole ? LAST_INDEX : LAST_COMMUNICATION;
  node->resets += whole ? 1u : 0u;
  store_read(node);
  const uint32_t asked = whole ? store_node_id(node) : node->value[OD_DEVICE_NODE_ID];
  node->node_id = (asked != 0u) ? asked : node->node_id;
  objects_defaults(node, 0, last);
  store_load(node, 0, last);
  node->queue.tail = node->queue.head;
  sdo_reset(node);
  emcy_reset(node);
  store_tell(node);
  if (whole) {
    cia402_reset(node);
  }
  nmt_reset(node);
  pdo_configure(node);
  node->wanted_fresh = true;
}

void canopen_init(canopen_t *node, app_t *app, const storage_t *storage, uint32_t node_id, uint32_t now_us) {
  node->app = app;
  node->storage = storage;
  node->node_id = node_id;
  node->now_us = now_us;
  node->queue.head = 0;
  node->queue.tail = 0;
  node->drive.in_control = false;
  reset(node, true);
}

void canopen_receive(canopen_t *node, const can_frame_t *frame) {
  const nmt_state_t state = node->nmt.state;
  // Nothing here is extended, and no remote frame is answered.
  if ((frame->flags & (CAN_EXTENDED | CAN_REMOTE)) != 0u || frame->length > 8u) {
    return;
  }
  if (frame->id == 0u) {
    const nmt_wish_t wish = nmt_command(node, frame);
    if (wish != NMT_NO_RESET) {
      reset(node, wish == NMT_RESET_NODE);
    }
  } else if (frame->id == node->value[OD_SYNC_COB_ID]) {
    if (state == NMT_OPERATIONAL && frame->length <= 1u) {
      pdo_sync(node);
    }
  } else if (frame->id == 0x600u + node->node_id) {
    if (state == NMT_OPERATIONAL || state == NMT_PRE_OPERATIONAL) {
      sdo_receive(node, frame);
    }
  } else if (frame->id > 0x700u && frame->id <= 0x77Fu) {
    if (frame->id == 0x700u + node->node_id) {
      emcy_event(node, EMCY_COLLISION, node->node_id);
    } else if (frame->length == 1u) {
      nmt_heartbeat(node, frame->id - 0x700u);
    }
  } else if (state == NMT_OPERATIONAL) {
    (void)pdo_receive(node, frame);
  }
}

void canopen_step(canopen_t *node, uint32_t now_us) {
  node->now_us = now_us;
  nmt_step(node);
  cia402_step(node);
  emcy_step(node);
  if (node->nmt.state == NMT_OPERATIONAL) {
    pdo_step(node);
  }
}

bool canopen_next(canopen_t *node, can_frame_t *frame) { return send_queue_take(&node->queue, frame); }

can_filter_t canopen_wanted(const canopen_t *node, uint32_t k) {
  can_filter_t filter = {.mask = 0x7FFu, .enable = true};
  switch (k) {
    case 0:  // NMT
      break;
    case 1:
      filter.id = node->value[OD_SYNC_COB_ID];
      break;
    case 2:
      filter.id = 0x600u + node->node_id;
      break;
    case 3:  // heartbeats of all where one is watched, else of this node-ID: there is another one
      filter.id = nmt_watches(node) ? 0x700u : 0x700u + node->node_id;
      filter.mask = nmt_watches(node) ? 0x780u : 0x7FFu;
      break;
    default:
      filter.id = node->pdo.rpdo[k - 4u].map.can_id;
      filter.enable = node->pdo.rpdo[k - 4u].map.enabled;
      break;
  }
  return filter;
}

void canopen_bus_off(canopen_t *node) {
  emcy_set(node, EMCY_BUS_OFF, 0);
  nmt_communication_error(node, emcy_cause_code(EMCY_BUS_OFF));
}

void canopen_bus_back(canopen_t *node) { emcy_clear(node, EMCY_BUS_OFF); }

void canopen_overrun(canopen_t *node) { emcy_event(node, EMCY_OVERRUN, 0); }
