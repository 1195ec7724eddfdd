// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Emergency object: what is wrong, told once each, the error register 0x1001 and the list 0x1003.
#ifndef FL_EMCY_H
#define FL_EMCY_H

#include <stdbool.h>
#include <stdint.h>

#include "canopen/timer.h"

typedef struct canopen canopen_t;

typedef enum {
  EMCY_DRIVE,            // the drive's fault, code by its number
  EMCY_HEARTBEAT,        // 0x8130
  EMCY_COMMAND_TIMEOUT,  // 0x8100
  EMCY_BUS_OFF,          // 0x8140: recovered from it
  EMCY_OVERRUN,          // 0x8110: frames were lost before they were read
  EMCY_PDO_SHORT,        // 0x8210: an RPDO was too short and was not taken
  EMCY_PDO_LONG,         // 0x8220: an RPDO was longer than its mapping; the first bytes were taken
  EMCY_PDO_VALUE,        // 0x8200: an RPDO held a value that is not allowed and was not taken
  EMCY_CAUSES,
} emcy_cause_t;

typedef struct {
  uint32_t active;   // bit n: cause n is there
  uint32_t untold;   // bit n: to be sent
  bool untold_end;   // all causes have gone
  uint16_t code[EMCY_CAUSES];
  uint8_t error[EMCY_CAUSES];  // bits of the error register
  uint32_t detail[EMCY_CAUSES];
  span_t inhibit;
} emcy_t;

// Nothing wrong, empty list.
void emcy_reset(canopen_t *node);
// A cause has come, or is there still. detail goes into bytes 4..7.
void emcy_set(canopen_t *node, emcy_cause_t cause, uint32_t detail);
// The fault of the drive with its code; fault: its number.
void emcy_set_drive(canopen_t *node, uint32_t fault);
void emcy_clear(canopen_t *node, emcy_cause_t cause);
// EMCY code of a fault number of the drive, 0: no fault.
uint32_t emcy_code(uint32_t fault);
// EMCY code of a cause.
uint32_t emcy_cause_code(emcy_cause_t cause);
// Empty the list 0x1003.
void emcy_forget(canopen_t *node);
// Send what is due, in operational and pre-operational.
void emcy_step(canopen_t *node);

#endif
