// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "canopen/pdo.h"

#include "canopen/abort.h"
#include "canopen/canopen.h"
#include "canopen/objects.h"
#include "control/placement.h"

SMALL_CODE_BEGIN

#define CALM_US 2000000u

// Something is wrong with the k-th one; its causes end when nothing was for a time: good and bad ones may take turns.
static void blame(canopen_t *node, uint32_t k, uint32_t cause, uint32_t detail) {
  span_start(&node->pdo.rpdo[k].wrong, node->now_us);
  emcy_set(node, (emcy_cause_t)(cause + k), detail);
}

static void refuse(canopen_t *node, uint32_t k, uint32_t cause, uint32_t detail) {
  node->value[OD_COUNTER_PDOS_REFUSED]++;
  blame(node, k, cause, detail);
}

// All of it or nothing: every value is checked before the first one is written.
static void take(canopen_t *node, uint32_t k, const uint8_t *data, uint32_t length) {
  const pdo_map_t *map = &node->pdo.rpdo[k].map;
  uint32_t value[PDO_MAPPED];
  uint32_t at = 0;
  if (length < map->length) {
    refuse(node, k, EMCY_PDO_SHORT, k + 1u);
    return;
  }
  for (uint32_t i = 0; i < map->count; i++) {
    const uint32_t number = map->number[i];
    value[i] = can_get(&data[at], map->bytes[i]);
    at += map->bytes[i];
    if (number != OD_COUNT) {
      value[i] = od_extend(number, value[i]);
      if (objects_check(node, number, value[i]) != SDO_OK) {
        refuse(node, k, EMCY_PDO_VALUE, (uint32_t)od_entry(number)->index << 16 | (k + 1u));
        return;
      }
    }
  }
  if (length > map->length) {
    blame(node, k, EMCY_PDO_LONG, k + 1u);
  } else if (span_over(&node->pdo.rpdo[k].wrong, node->now_us, CALM_US)) {
    pdo_forgive(node, k);
  }
  for (uint32_t i = 0; i < map->count; i++) {
    if (map->number[i] != OD_COUNT) {
      (void)objects_write(node, map->number[i], value[i]);
    }
  }
  drive_heard(&node->app->drive);
}

bool pdo_receive(canopen_t *node, const can_frame_t *frame) {
  for (uint32_t k = 0; k < PDO_COUNT; k++) {
    rpdo_t *pdo = &node->pdo.rpdo[k];
    if (!pdo->map.enabled || pdo->map.can_id != frame->id) {
      continue;
    }
    if (pdo->map.type > PDO_TYPE_CYCLIC_MAX) {
      take(node, k, frame->data, frame->length);
    } else {
      for (uint32_t i = 0; i < frame->length; i++) {
        pdo->data[i] = frame->data[i];
      }
      pdo->data_length = frame->length;
      pdo->waiting = true;
    }
    return true;
  }
  return false;
}

static void compose(canopen_t *node, const pdo_map_t *map, uint8_t data[8]) {
  uint32_t at = 0;
  for (uint32_t i = 0; i < map->count; i++) {
    can_put(&data[at], map->bytes[i], objects_read(node, map->number[i]));
    at += map->bytes[i];
  }
}

static bool differs(const tpdo_t *pdo, const uint8_t data[8]) {
  for (uint32_t i = 0; i < pdo->map.length; i++) {
    if (pdo->data[i] != data[i]) {
      return true;
    }
  }
  return !pdo->told;
}

static void tell(canopen_t *node, tpdo_t *pdo, const uint8_t data[8]) {
  if (!canopen_send(node, pdo->map.can_id, data, pdo->map.length, true)) {
    return;
  }
  for (uint32_t i = 0; i < pdo->map.length; i++) {
    pdo->data[i] = data[i];
  }
  pdo->told = true;
  pdo->syncs = 0;
  span_start(&pdo->inhibit, node->now_us);
  span_start(&pdo->event, node->now_us);
}

void pdo_sync(canopen_t *node) {
  for (uint32_t k = 0; k < PDO_COUNT; k++) {
    rpdo_t *pdo = &node->pdo.rpdo[k];
    if (pdo->waiting) {
      pdo->waiting = false;
      take(node, k, pdo->data, pdo->data_length);
    }
  }
  for (uint32_t k = 0; k < PDO_COUNT; k++) {
    tpdo_t *pdo = &node->pdo.tpdo[k];
    if (!pdo->map.enabled || pdo->map.type > PDO_TYPE_CYCLIC_MAX) {
      continue;
    }
    uint8_t data[8] = {0};
    compose(node, &pdo->map, data);
    pdo->syncs++;
    if ((pdo->map.type == 0u) ? differs(pdo, data) : pdo->syncs >= pdo->map.type) {
      tell(node, pdo, data);
    }
  }
}

void pdo_step(canopen_t *node) {
  for (uint32_t k = 0; k < PDO_COUNT; k++) {
    tpdo_t *pdo = &node->pdo.tpdo[k];
    if (!pdo->map.enabled || pdo->map.type < PDO_TYPE_EVENT_MIN) {
      continue;
    }
    (void)span_over(&pdo->inhibit, node->now_us, node->value[OD_TPDO1_INHIBIT_TIME + k * PDO_TPDO_STEP] * 100u);
    const uint32_t event_us = node->value[OD_TPDO1_EVENT_TIMER + k * PDO_TPDO_STEP] * 1000u;
    // A span that stays: it ends when the PDO is sent.
    const bool due = event_us != 0u && pdo->event.running && node->now_us - pdo->event.from_us >= event_us;
    if (pdo->inhibit.running) {
      continue;
    }
    uint8_t data[8] = {0};
    compose(node, &pdo->map, data);
    if (due || differs(pdo, data)) {
      tell(node, pdo, data);
    }
  }
}

SMALL_CODE_END
