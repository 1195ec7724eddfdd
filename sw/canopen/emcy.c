// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "canopen/emcy.h"

#include "canopen/canopen.h"
#include "control/placement.h"

SMALL_CODE_BEGIN

#define LIST_LENGTH (OD_ERROR_FIELD_ERROR_8 - OD_ERROR_FIELD_ERROR_1 + 1u)
#define ERROR_GENERIC 0x01u
#define ERROR_COMMUNICATION 0x11u
#define ERROR_MANUFACTURER 0x81u
#define DISABLED (1u << 31)
#define EVENT_US 2000000u

typedef struct {
  uint16_t code;
  uint8_t error;
} emcy_kind_t;

static const emcy_kind_t *kind_of_fault(uint32_t fault) {
  static const emcy_kind_t kinds[FAULT_COUNT] = FAULT_ERRORS;
  return &kinds[(fault < (uint32_t)FAULT_COUNT) ? fault : (uint32_t)FAULT_NONE];
}

uint32_t emcy_code(uint32_t fault) { return kind_of_fault(fault)->code; }

uint32_t emcy_cause_code(emcy_cause_t cause) {
  static const uint16_t codes[EMCY_HEARTBEAT] = {
      [EMCY_COMMAND_TIMEOUT] = 0x8100u,
      [EMCY_BUS_OFF] = 0x8140u,
      [EMCY_OVERRUN] = 0x8110u,
      [EMCY_COLLISION] = 0x8150u,
      [EMCY_STORE_LOST] = 0x6310u,
      [EMCY_STORE_COPY] = 0x5530u,
  };
  if (cause < EMCY_HEARTBEAT) {
    return codes[cause];
  }
  if (cause < EMCY_PDO_SHORT) {
    return 0x8130u;
  }
  return (cause < EMCY_PDO_LONG) ? 0x8210u : (cause < EMCY_PDO_VALUE) ? 0x8220u : 0x8200u;
}

void emcy_forget(canopen_t *node) {
  for (uint32_t n = OD_ERROR_FIELD_COUNT; n <= OD_ERROR_FIELD_ERROR_8; n++) {
    node->value[n] = 0;
  }
}

void emcy_reset(canopen_t *node) {
  node->emcy = (emcy_t){0};
  emcy_forget(node);
}

// What is active, and that the operation waits for its reset.
static void show_register(canopen_t *node) {
  const pds_t operation = node->drive.state;
  uint32_t error = (operation == PDS_FAULT || operation == PDS_FAULT_REACTION) ? ERROR_GENERIC : 0u;
  for (uint32_t c = 0; c < EMCY_CAUSES; c++) {
    error |= ((node->emcy.active >> c & 1u) != 0u) ? node->emcy.error[c] : 0u;
  }
  node->value[OD_ERROR_REGISTER] = error;
}

static void set(canopen_t *node, emcy_cause_t cause, uint32_t code, uint32_t error, uint32_t detail) {
  emcy_t *e = &node->emcy;
  const uint32_t bit = 1u << cause;
  if ((e->active & bit) != 0u && e->code[cause] == code) {
    return;
  }
  emcy_clear(node, cause);  // with another code: the one before is over
  // Its end before is told first, but for one whose beginning was not.
  if ((e->untold & bit) != 0u) {
    e->ended &= ~bit;
  }
  e->active |= bit;
  e->untold |= bit;
  e->code[cause] = (uint16_t)code;
  e->error[cause] = (uint8_t)error;
  e->detail[cause] = detail;
  show_register(node);
  for (uint32_t n = LIST_LENGTH - 1u; n > 0u; n--) {
    node->value[OD_ERROR_FIELD_ERROR_1 + n] = node->value[OD_ERROR_FIELD_ERROR_1 + n - 1u];
  }
  const uint32_t fault = (cause == EMCY_DRIVE) ? detail : 0u;
  node->value[OD_ERROR_FIELD_ERROR_1] = fault << 16 | code;
  if (node->value[OD_ERROR_FIELD_COUNT] < LIST_LENGTH) {
    node->value[OD_ERROR_FIELD_COUNT]++;
  }
}

void emcy_set(canopen_t *node, emcy_cause_t cause, uint32_t detail) {
  const bool stored = cause == EMCY_STORE_LOST || cause == EMCY_STORE_COPY;
  set(node, cause, emcy_cause_code(cause), stored ? ERROR_MANUFACTURER : ERROR_COMMUNICATION, detail);
}

void emcy_set_drive(canopen_t *node, uint32_t fault) {
  const emcy_kind_t *kind = kind_of_fault(fault);
  set(node, EMCY_DRIVE, kind->code, kind->error, fault);
}

void emcy_clear(canopen_t *node, emcy_cause_t cause) {
  emcy_t *e = &node->emcy;
  if ((e->active >> cause & 1u) == 0u) {
    return;
  }
  const uint32_t bit = 1u << cause;
  if ((e->ended & bit) != 0u) {
    e->untold &= ~bit;  // the end of the one before stands for this one, too
  }
  e->active &= ~bit;
  e->ended |= bit;
  e->ended_code = (cause == EMCY_DRIVE) ? e->code[cause] : e->ended_code;
  show_register(node);
}

void emcy_event(canopen_t *node, emcy_cause_t cause, uint32_t detail) {
  emcy_set(node, cause, detail);
  span_start(&node->emcy.event[cause - EMCY_OVERRUN], node->now_us);
}

// In turn: none waits for ever behind one that comes and goes. One at least is to be told.
static uint32_t next_cause(const emcy_t *e) {
  uint32_t cause = e->next;
  while (((e->untold | e->ended) >> cause & 1u) == 0u) {
    cause = (cause + 1u) % (uint32_t)EMCY_CAUSES;
  }
  return cause;
}

// What came and went before it was told begins, then ends; what has come again ends first.
void emcy_step(canopen_t *node) {
  emcy_t *e = &node->emcy;
  const uint32_t cob_id = node->value[OD_EMCY_COB_ID];
  show_register(node);
  if (node->nmt.state != NMT_OPERATIONAL && node->nmt.state != NMT_PRE_OPERATIONAL) {
    return;
  }
  for (uint32_t k = 0; k < EMCY_EVENTS; k++) {
    if (span_over(&e->event[k], node->now_us, EVENT_US)) {
      emcy_clear(node, (emcy_cause_t)(EMCY_OVERRUN + k));
    }
  }
  (void)span_over(&e->inhibit, node->now_us, node->value[OD_EMCY_INHIBIT_TIME] * 100u);
  if (e->inhibit.running || (e->untold | e->ended) == 0u || (cob_id & DISABLED) != 0u) {
    return;
  }
  uint8_t data[8] = {0};
  const uint32_t cause = next_cause(e);
  const bool again = (e->ended >> cause & 1u) != 0u && (e->active >> cause & 1u) != 0u;
  const bool begins = (e->untold >> cause & 1u) != 0u && !again;
  if (begins) {
    can_put(&data[0], 2, e->code[cause]);
    data[3] = (uint8_t)((cause == EMCY_DRIVE) ? e->detail[cause] : 0u);
    can_put(&data[4], 4, (cause == EMCY_DRIVE) ? 0u : e->detail[cause]);
  } else {
    can_put(&data[4], 2, (cause == EMCY_DRIVE) ? e->ended_code : e->code[cause]);
  }
  data[2] = (uint8_t)node->value[OD_ERROR_REGISTER];
  if (canopen_send(node, cob_id & 0x7FFu, data, 8, false)) {
    uint32_t *told = begins ? &e->untold : &e->ended;
    *told &= ~(1u << cause);
    e->next = (cause + 1u) % (uint32_t)EMCY_CAUSES;
    span_start(&e->inhibit, node->now_us);
  }
}

SMALL_CODE_END
