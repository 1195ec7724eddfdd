// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "canopen/emcy.h"

#include "canopen/canopen.h"
#include "control/placement.h"

SMALL_CODE_BEGIN

#define LIST_LENGTH (OD_ERROR_FIELD_ERROR_8 - OD_ERROR_FIELD_ERROR_1 + 1u)
#define ERROR_COMMUNICATION 0x11u
#define DISABLED (1u << 31)

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
  static const uint16_t codes[EMCY_CAUSES] = {
      [EMCY_HEARTBEAT] = 0x8130u, [EMCY_COMMAND_TIMEOUT] = 0x8100u, [EMCY_BUS_OFF] = 0x8140u,
      [EMCY_OVERRUN] = 0x8110u,
      [EMCY_PDO_SHORT] = 0x8210u, [EMCY_PDO_LONG] = 0x8220u,        [EMCY_PDO_VALUE] = 0x8200u,
  };
  return codes[cause];
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

static void show_register(canopen_t *node) {
  uint32_t error = 0;
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
  e->active |= bit;
  e->untold |= bit;
  e->untold_end = false;
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
  set(node, cause, emcy_cause_code(cause), ERROR_COMMUNICATION, detail);
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
  e->active &= ~(1u << cause);
  e->untold_end = e->active == 0u;
  show_register(node);
}

// What came and went before it was told is told first, then that all is well.
void emcy_step(canopen_t *node) {
  emcy_t *e = &node->emcy;
  const uint32_t cob_id = node->value[OD_EMCY_COB_ID];
  if (node->nmt.state != NMT_OPERATIONAL && node->nmt.state != NMT_PRE_OPERATIONAL) {
    return;
  }
  (void)span_over(&e->inhibit, node->now_us, node->value[OD_EMCY_INHIBIT_TIME] * 100u);
  if (e->inhibit.running || (e->untold == 0u && !e->untold_end) || (cob_id & DISABLED) != 0u) {
    return;
  }
  uint8_t data[8] = {0};
  uint32_t cause = 0;
  if (e->untold != 0u) {
    while ((e->untold >> cause & 1u) == 0u) {
      cause++;
    }
    can_put(&data[0], 2, e->code[cause]);
    data[3] = (uint8_t)((cause == EMCY_DRIVE) ? e->detail[cause] : 0u);
    can_put(&data[4], 4, (cause == EMCY_DRIVE) ? 0u : e->detail[cause]);
  }
  data[2] = (uint8_t)node->value[OD_ERROR_REGISTER];
  if (canopen_send(node, cob_id & 0x7FFu, data, 8, false)) {
    if (e->untold != 0u) {
      e->untold &= ~(1u << cause);
    } else {
      e->untold_end = false;
    }
    span_start(&e->inhibit, node->now_us);
  }
}

SMALL_CODE_END
