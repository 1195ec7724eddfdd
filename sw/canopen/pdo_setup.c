// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "canopen/abort.h"
#include "canopen/canopen.h"
#include "canopen/pdo.h"
#include "control/placement.h"

SMALL_CODE_BEGIN

#define DISABLED (1u << 31)
#define NO_REMOTE (1u << 30)
// Numbers of the entries from one PDO to the next.
#define RPDO_STEP (OD_RPDO2_COUNT - OD_RPDO1_COUNT)
#define INHIBIT_AFTER_COB_ID (OD_TPDO1_INHIBIT_TIME - OD_TPDO1_COB_ID)
#define MAPPING_STEP (OD_RPDO2_MAPPING_COUNT - OD_RPDO1_MAPPING_COUNT)

// Objects of one PDO: 0x1400 and 0x1800 and on hold the first three at the same distances.
typedef struct {
  uint32_t cob_id;
  uint32_t type;
  uint32_t count;  // of its mapping
  uint32_t first;  // mapping object
  uint32_t direction;  // flag of what may be mapped
} place_t;

static place_t place(bool receive, uint32_t k) {
  if (receive) {
    return (place_t){OD_RPDO1_COB_ID + k * RPDO_STEP, OD_RPDO1_TYPE + k * RPDO_STEP,
                     OD_RPDO1_MAPPING_COUNT + k * MAPPING_STEP, OD_RPDO1_MAPPING_OBJECT_1 + k * MAPPING_STEP,
                     OD_RECEIVABLE};
  }
  return (place_t){OD_TPDO1_COB_ID + k * PDO_TPDO_STEP, OD_TPDO1_TYPE + k * PDO_TPDO_STEP,
                   OD_TPDO1_MAPPING_COUNT + k * MAPPING_STEP, OD_TPDO1_MAPPING_OBJECT_1 + k * MAPPING_STEP, OD_SENDABLE};
}

static bool has_id(const canopen_t *node, uint32_t number, uint32_t can_id) {
  const uint32_t value = node->value[number];
  return (value & DISABLED) == 0u && (value & 0x7FFu) == can_id;
}

// NMT and heartbeats are among the reserved ones, the own SDO too.
static bool in_use(const canopen_t *node, uint32_t number, uint32_t can_id) {
  bool used = number != OD_SYNC_COB_ID && node->value[OD_SYNC_COB_ID] == can_id;
  used = used || (number != OD_EMCY_COB_ID && has_id(node, OD_EMCY_COB_ID, can_id));
  for (uint32_t k = 0; k < PDO_COUNT; k++) {
    const uint32_t receive = OD_RPDO1_COB_ID + k * RPDO_STEP;
    const uint32_t send = OD_TPDO1_COB_ID + k * PDO_TPDO_STEP;
    used = used || (number != receive && has_id(node, receive, can_id));
    used = used || (number != send && has_id(node, send, can_id));
  }
  return used;
}

bool pdo_id_is_free(const canopen_t *node, uint32_t number, uint32_t can_id) {
  const bool reserved = can_id < 0x080u || (can_id > 0x100u && can_id <= 0x180u) ||
                        (can_id > 0x580u && can_id < 0x600u) || (can_id > 0x600u && can_id < 0x680u) ||
                        (can_id >= 0x6E0u && can_id < 0x700u) || can_id > 0x700u;
  return !reserved && can_id < 0x800u && !in_use(node, number, can_id);
}

static bool taken(const canopen_t *node, uint32_t number) {
  const uint32_t value = node->value[number];
  const bool chosen = value != od_default(number, node->node_id);
  return chosen && (value & DISABLED) == 0u && !pdo_id_is_free(node, number, value & 0x7FFu);
}

uint32_t pdo_id_taken(const canopen_t *node) {
  if (taken(node, OD_SYNC_COB_ID)) {
    return OD_SYNC_COB_ID;
  }
  uint32_t found = taken(node, OD_EMCY_COB_ID) ? (uint32_t)OD_EMCY_COB_ID : (uint32_t)OD_COUNT;
  for (uint32_t k = 0; k < 2u * PDO_COUNT && found == (uint32_t)OD_COUNT; k++) {
    const uint32_t number = place(k < PDO_COUNT, k % PDO_COUNT).cob_id;
    found = taken(node, number) ? number : found;
  }
  return found;
}

// A mapping word: number of the entry (OD_COUNT: a dummy of the standard's basic types) and bytes; false: impossible.
static bool mapped(uint32_t word, uint32_t direction, uint32_t *number, uint32_t *bytes, uint32_t *abort) {
  const uint32_t index = word >> 16;
  const uint32_t bits = word & 0xFFu;
  *bytes = bits / 8u;
  if (direction == OD_RECEIVABLE && index >= OD_U8 && index <= OD_U32) {
    *number = OD_COUNT;
    *abort = SDO_NOT_MAPPABLE;
    return (word >> 8 & 0xFFu) == 0u && bits == 8u << (index - OD_U8);
  }
  *number = od_find(index, word >> 8 & 0xFFu, abort);
  if (*number == OD_COUNT) {
    return false;
  }
  *abort = SDO_NOT_MAPPABLE;
  return (od_entry(*number)->flags & direction) != 0u && bits == 8u * od_bytes(*number);
}

// The first `count` mapping objects together; SDO_OK or why not.
static uint32_t check_count(const canopen_t *node, const place_t *at, uint32_t count) {
  uint32_t length = 0;
  for (uint32_t i = 0; i < count; i++) {
    uint32_t number;
    uint32_t bytes;
    uint32_t abort;
    if (!mapped(node->value[at->first + i], at->direction, &number, &bytes, &abort)) {
      return abort;
    }
    length += bytes;
  }
  return (length > 8u) ? SDO_MAPPING_TOO_LONG : SDO_OK;
}

static uint32_t check_cob_id(const canopen_t *node, uint32_t number, uint32_t value) {
  const uint32_t old = node->value[number];
  if ((value & ~(DISABLED | NO_REMOTE | 0x7FFu)) != 0u) {
    return SDO_VALUE;
  }
  // The ID of a PDO in use stays.
  if ((old & DISABLED) == 0u && (value & DISABLED) == 0u && ((old ^ value) & 0x7FFu) != 0u) {
    return SDO_STATE;
  }
  return ((value & DISABLED) != 0u || pdo_id_is_free(node, number, value & 0x7FFu)) ? SDO_OK : SDO_VALUE;
}

static uint32_t check_mapping(const canopen_t *node, const place_t *at, uint32_t number, uint32_t value) {
  if ((node->value[at->cob_id] & DISABLED) == 0u) {
    return SDO_STATE;
  }
  if (number == at->count) {
    return check_count(node, at, value);
  }
  uint32_t other;
  uint32_t bytes;
  uint32_t abort;
  if (node->value[at->count] != 0u) {
    return SDO_STATE;
  }
  return (value == 0u || mapped(value, at->direction, &other, &bytes, &abort)) ? SDO_OK : abort;
}

uint32_t pdo_check(canopen_t *node, uint32_t number, uint32_t value) {
  const uint32_t index = od_entry(number)->index;
  const bool receive = index < 0x1800u;
  const place_t at = place(receive, index & 0x1FFu);
  if ((index & 0x200u) != 0u) {
    return check_mapping(node, &at, number, value);
  }
  if (number == at.cob_id) {
    return check_cob_id(node, number, value);
  }
  if (number == at.type) {
    return (value <= PDO_TYPE_CYCLIC_MAX || value >= PDO_TYPE_EVENT_MIN) ? SDO_OK : SDO_VALUE;
  }
  if (number == at.cob_id + INHIBIT_AFTER_COB_ID && !receive && (node->value[at.cob_id] & DISABLED) == 0u) {
    return SDO_STATE;
  }
  return SDO_OK;
}

static void configure(canopen_t *node, const place_t *at, pdo_map_t *map) {
  *map = (pdo_map_t){.can_id = node->value[at->cob_id] & 0x7FFu, .type = node->value[at->type]};
  const uint32_t count = node->value[at->count];
  const bool good = count <= PDO_MAPPED && check_count(node, at, count) == SDO_OK;
  map->enabled = good && (node->value[at->cob_id] & DISABLED) == 0u;
  map->count = good ? count : 0u;
  for (uint32_t i = 0; i < map->count; i++) {
    uint32_t abort;
    (void)mapped(node->value[at->first + i], at->direction, &map->number[i], &map->bytes[i], &abort);
    map->length += map->bytes[i];
  }
}

void pdo_forgive(canopen_t *node, uint32_t k) {
  emcy_clear(node, (emcy_cause_t)(EMCY_PDO_SHORT + k));
  emcy_clear(node, (emcy_cause_t)(EMCY_PDO_LONG + k));
  emcy_clear(node, (emcy_cause_t)(EMCY_PDO_VALUE + k));
}

void pdo_configure(canopen_t *node) {
  for (uint32_t k = 0; k < PDO_COUNT; k++) {
    const place_t receive = place(true, k);
    const place_t send = place(false, k);
    configure(node, &receive, &node->pdo.rpdo[k].map);
    configure(node, &send, &node->pdo.tpdo[k].map);
    node->pdo.rpdo[k].waiting = false;
    if (!node->pdo.rpdo[k].map.enabled) {
      pdo_forgive(node, k);
    }
  }
}

void pdo_start(canopen_t *node) {
  for (uint32_t k = 0; k < PDO_COUNT; k++) {
    node->pdo.rpdo[k].waiting = false;
    tpdo_t *pdo = &node->pdo.tpdo[k];
    pdo->told = false;
    pdo->syncs = 0;
    pdo->inhibit.running = false;
    pdo->event.running = false;
  }
}

SMALL_CODE_END
