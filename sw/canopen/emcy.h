// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Emergency object: the set of active causes. Each one's beginning and end is told, and its next beginning again;
// beginnings enter the list 0x1003, the error register 0x1001 holds the bits of what is active, and bit 0 for as long as the
// operation is in a fault.
//
// The end of a cause has code 0, the register of what is left, and the code that has ended in bytes 4 and 5.
#ifndef FL_EMCY_H
#define FL_EMCY_H

#include <stdbool.h>
#include <stdint.h>

#include "canopen/nmt.h"
#include "canopen/pdo.h"
#include "canopen/timer.h"

typedef struct canopen canopen_t;

typedef enum {
  EMCY_DRIVE,            // the drive's fault, code by its number
  EMCY_COMMAND_TIMEOUT,  // 0x8100
  EMCY_BUS_OFF,          // 0x8140: recovered from it
  EMCY_OVERRUN,          // 0x8110: frames were lost before they were read
  EMCY_COLLISION,        // 0x8150: another node sends heartbeats of this node-ID
  EMCY_STORE_LOST,       // 0x6310: something is stored and cannot be taken; no operation until a save or a restore
  EMCY_STORE_COPY,       // 0x5530: one of two copies of what is stored is left; a save makes the other one
  EMCY_HEARTBEAT,        // 0x8130, one for each consumer: its node has fallen silent
  EMCY_PDO_SHORT = EMCY_HEARTBEAT + NMT_CONSUMERS,  // 0x8210, one for each RPDO: too short, not taken
  EMCY_PDO_LONG = EMCY_PDO_SHORT + PDO_COUNT,       // 0x8220: longer than its mapping; the first bytes were taken
  EMCY_PDO_VALUE = EMCY_PDO_LONG + PDO_COUNT,       // 0x8200: a value that is not allowed, not taken
  EMCY_CAUSES = EMCY_PDO_VALUE + PDO_COUNT,
} emcy_cause_t;

_Static_assert((uint32_t)EMCY_CAUSES <= 32u, "a bit for each cause");

#define EMCY_EVENTS 2u  // causes that have no end of their own: EMCY_OVERRUN, EMCY_COLLISION

typedef struct {
  uint32_t active;   // bit n: cause n is there
  uint32_t untold;   // bit n: its beginning is to be sent
  uint32_t ended;    // bit n: its end is to be sent
  uint32_t next;     // cause whose turn it is
  uint16_t ended_code;  // of the drive's fault that has ended
  uint16_t code[EMCY_CAUSES];
  uint8_t error[EMCY_CAUSES];  // bits of the error register
  uint32_t detail[EMCY_CAUSES];
  span_t event[EMCY_EVENTS];  // since the last one
  span_t inhibit;
} emcy_t;

// Nothing wrong, empty list.
void emcy_reset(canopen_t *node);
// A cause has come, or is there still. detail goes into bytes 4..7.
void emcy_set(canopen_t *node, emcy_cause_t cause, uint32_t detail);
// The fault of the drive with its code; fault: its number.
void emcy_set_drive(canopen_t *node, uint32_t fault);
void emcy_clear(canopen_t *node, emcy_cause_t cause);
// An event of a cause that ends when none has come for 2 s.
void emcy_event(canopen_t *node, emcy_cause_t cause, uint32_t detail);
// EMCY code of a fault number of the drive, 0: no fault.
uint32_t emcy_code(uint32_t fault);
// EMCY code of a cause.
uint32_t emcy_cause_code(emcy_cause_t cause);
// Empty the list 0x1003.
void emcy_forget(canopen_t *node);
// Send what is due, in operational and pre-operational.
void emcy_step(canopen_t *node);

#endif
