// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "canopen/dictionary.h"

#include "canopen/abort.h"
#include "control/placement.h"
#include "hal/can.h"
#include "hal/chip.h"

SMALL_CODE_BEGIN

static const od_entry_t entries[OD_COUNT] = OD_ENTRIES;

const od_entry_t *od_entry(uint32_t number) { return &entries[number]; }

uint32_t od_find(uint32_t index, uint32_t sub, uint32_t *abort) {
  const uint32_t wanted = index << 8 | sub;
  uint32_t low = 0;
  uint32_t high = OD_COUNT;
  while (low < high) {
    const uint32_t middle = (low + high) / 2u;
    if (((uint32_t)entries[middle].index << 8 | entries[middle].sub) < wanted) {
      low = middle + 1u;
    } else {
      high = middle;
    }
  }
  if (low < OD_COUNT && entries[low].index == index && entries[low].sub == sub) {
    return low;
  }
  const bool known = (low < OD_COUNT && entries[low].index == index) || (low > 0u && entries[low - 1u].index == index);
  *abort = known ? SDO_NO_SUB_INDEX : SDO_NO_OBJECT;
  return OD_COUNT;
}

static bool is_signed(uint32_t type) { return type <= OD_I32; }

uint32_t od_bytes(uint32_t number) {
  switch (entries[number].type) {
    case OD_I8:
    case OD_U8:
      return 1;
    case OD_I16:
    case OD_U16:
      return 2;
    case OD_I32:
    case OD_U32:
      return 4;
    default:
      return 0;
  }
}

uint32_t od_extend(uint32_t number, uint32_t value) {
  const uint32_t bits = 8u * od_bytes(number);
  if (bits == 0u || bits == 32u) {
    return value;
  }
  const uint32_t cut = value & ((1u << bits) - 1u);
  const bool negative = is_signed(entries[number].type) && (cut >> (bits - 1u)) != 0u;
  return negative ? cut | ~((1u << bits) - 1u) : cut;
}

uint32_t od_default(uint32_t number, uint32_t node_id) {
  const od_entry_t *e = &entries[number];
  return e->initial + (((e->flags & OD_NODE_RELATIVE) != 0u) ? node_id : 0u);
}

uint32_t od_check(uint32_t number, uint32_t value) {
  const od_entry_t *e = &entries[number];
  // With a sign the order is kept by turning the highest bit.
  const uint32_t turn = is_signed(e->type) ? 1u << 31 : 0u;
  if ((value ^ turn) > (e->max ^ turn)) {
    return SDO_VALUE_HIGH;
  }
  if ((value ^ turn) < (e->min ^ turn)) {
    return SDO_VALUE_LOW;
  }
  if (e->choices != 0u && (value > 15u || ((uint32_t)e->choices >> value & 1u) == 0u)) {
    return SDO_VALUE;
  }
  if (number == (uint32_t)OD_DEVICE_BIT_RATE && can_bit_timing(chip_clock_hz(), value) == 0u) {
    return SDO_VALUE;
  }
  return SDO_OK;
}

const char *od_string(uint32_t number) {
  static const struct {
    uint32_t number;
    const char *text;
  } strings[] = OD_STRINGS;
  for (uint32_t i = 0; i < sizeof strings / sizeof strings[0]; i++) {
    if (strings[i].number == number) {
      return strings[i].text;
    }
  }
  return 0;
}

SMALL_CODE_END
