// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "canopen/nmt.h"

#include "canopen/canopen.h"
#include "control/placement.h"

SMALL_CODE_BEGIN

enum { START = 1, STOP = 2, ENTER_PRE_OPERATIONAL = 128, RESET_NODE = 129, RESET_COMMUNICATION = 130 };

void nmt_reset(canopen_t *node) { node->nmt = (nmt_t){.state = NMT_PRE_OPERATIONAL}; }

static void enter(canopen_t *node, nmt_state_t state) {
  const bool left = node->nmt.state == NMT_OPERATIONAL && state != NMT_OPERATIONAL;
  node->nmt.state = state;
  // Told at once, as a change of state is what a master waits for.
  span_start(&node->nmt.heartbeat, node->now_us - 65536000u);
  if (state == NMT_OPERATIONAL) {
    pdo_start(node);
  }
  if (left) {
    cia402_connection_lost(node, 0x8100u);
  }
}

nmt_wish_t nmt_command(canopen_t *node, const can_frame_t *frame) {
  if (frame->length != 2u || (frame->data[1] != 0u && frame->data[1] != node->node_id)) {
    return NMT_NO_RESET;
  }
  switch (frame->data[0]) {
    case START:
      enter(node, NMT_OPERATIONAL);
      break;
    case STOP:
      enter(node, NMT_STOPPED);
      break;
    case ENTER_PRE_OPERATIONAL:
      enter(node, NMT_PRE_OPERATIONAL);
      break;
    case RESET_NODE:
      return NMT_RESET_NODE;
    case RESET_COMMUNICATION:
      enter(node, NMT_PRE_OPERATIONAL);
      return NMT_RESET_COMMUNICATION;
    default:
      break;
  }
  return NMT_NO_RESET;
}

static uint32_t watched(const canopen_t *node, uint32_t k) { return node->value[OD_HEARTBEAT_CONSUMER_NODE_1 + k]; }

bool nmt_watches(const canopen_t *node) {
  bool any = false;
  for (uint32_t k = 0; k < NMT_CONSUMERS; k++) {
    any = any || (watched(node, k) & 0xFFFFu) != 0u;
  }
  return any;
}

void nmt_heartbeat(canopen_t *node, uint32_t id) {
  for (uint32_t k = 0; k < NMT_CONSUMERS; k++) {
    if (watched(node, k) >> 16 == id && (watched(node, k) & 0xFFFFu) != 0u) {
      span_start(&node->nmt.watch[k], node->now_us);
      emcy_clear(node, (emcy_cause_t)(EMCY_HEARTBEAT + k));
    }
  }
}

void nmt_watch(canopen_t *node, uint32_t k) {
  node->nmt.watch[k].running = false;
  emcy_clear(node, (emcy_cause_t)(EMCY_HEARTBEAT + k));
}

void nmt_communication_error(canopen_t *node, uint32_t code) {
  const uint32_t behaviour = node->value[OD_ERROR_BEHAVIOUR_COMMUNICATION];
  cia402_connection_lost(node, code);
  if (behaviour == 2u) {
    enter(node, NMT_STOPPED);
  } else if (behaviour == 0u && node->nmt.state == NMT_OPERATIONAL) {
    enter(node, NMT_PRE_OPERATIONAL);
  }
}

void nmt_step(canopen_t *node) {
  nmt_t *nmt = &node->nmt;
  if (!nmt->boot_told) {
    const uint8_t boot_up[1] = {NMT_BOOT_UP};
    nmt->boot_told = canopen_send(node, 0x700u + node->node_id, boot_up, 1, false);
    span_start(&nmt->heartbeat, node->now_us);
  }
  for (uint32_t k = 0; k < NMT_CONSUMERS; k++) {
    const uint32_t time_us = (watched(node, k) & 0xFFFFu) * 1000u;
    if (span_over(&nmt->watch[k], node->now_us, time_us)) {
      emcy_set(node, (emcy_cause_t)(EMCY_HEARTBEAT + k), watched(node, k) >> 16);
      nmt_communication_error(node, emcy_cause_code(EMCY_HEARTBEAT));
    }
  }
  const uint32_t period_us = node->value[OD_HEARTBEAT_PRODUCER] * 1000u;
  if (period_us != 0u && span_over(&nmt->heartbeat, node->now_us, period_us)) {
    const uint8_t data[1] = {(uint8_t)nmt->state};
    (void)canopen_send(node, 0x700u + node->node_id, data, 1, false);
    span_start(&nmt->heartbeat, node->now_us);
  } else if (period_us == 0u || !nmt->heartbeat.running) {
    span_start(&nmt->heartbeat, node->now_us);
  }
}

SMALL_CODE_END
