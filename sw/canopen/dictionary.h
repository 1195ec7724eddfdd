// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// The table of the object dictionary, generated from objects.toml: what entries there are, their types and ranges.
#ifndef FL_DICTIONARY_H
#define FL_DICTIONARY_H

#include <stdbool.h>
#include <stdint.h>

#include "canopen_objects.h"

// Data types by their codes in the standard.
enum { OD_I8 = 2, OD_I16 = 3, OD_I32 = 4, OD_U8 = 5, OD_U16 = 6, OD_U32 = 7, OD_STRING = 9, OD_DOMAIN = 15 };

enum {
  OD_READ = 1u << 0,
  OD_WRITE = 1u << 1,
  OD_RECEIVABLE = 1u << 2,     // may be mapped into an RPDO
  OD_SENDABLE = 1u << 3,       // into a TPDO
  OD_STORED = 1u << 4,
  OD_LIVE = 1u << 5,           // read from the drive at every access
  OD_NODE_RELATIVE = 1u << 6,  // the node-ID is added to the initial value
  OD_LIMIT = 1u << 7,          // a limit: the least value where the stored one is lost
};

typedef struct {
  uint16_t index;
  uint8_t sub;
  uint8_t type;
  uint8_t flags;
  uint16_t choices;  // bit n: the value n is allowed; 0: every one within min..max
  uint32_t min;      // two's complement where the type has a sign
  uint32_t max;
  uint32_t initial;
} od_entry_t;

// Entry of a number below OD_COUNT.
const od_entry_t *od_entry(uint32_t number);
// Number of an entry; OD_COUNT and the abort code if there is none. At most 9 comparisons.
uint32_t od_find(uint32_t index, uint32_t sub, uint32_t *abort);
// Bytes of a number, 0 of a string or a domain.
uint32_t od_bytes(uint32_t number);
// The value as its type holds it: cut, and extended by its sign.
uint32_t od_extend(uint32_t number, uint32_t value);
// What an entry of a node with this ID has without a master and a store.
uint32_t od_default(uint32_t number, uint32_t node_id);
// SDO_OK, or why the value is not allowed: out of its range, or a bit rate of which the clock has no whole bits.
uint32_t od_check(uint32_t number, uint32_t value);
// Text of a constant string; 0: none.
const char *od_string(uint32_t number);

#endif
