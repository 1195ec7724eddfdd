// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// A CAN 2.0 frame as the node and its driver hand it over.
#ifndef FL_CAN_FRAME_H
#define FL_CAN_FRAME_H

#include <stdint.h>

enum { CAN_EXTENDED = 1u << 0, CAN_REMOTE = 1u << 1 };

typedef struct {
  uint32_t id;     // 11 bits, 29 with CAN_EXTENDED
  uint8_t flags;   // CAN_EXTENDED, CAN_REMOTE
  uint8_t length;  // bytes of data, 0..8
  uint8_t data[8];
} can_frame_t;

// Little-endian numbers of 1..4 bytes in the data.
static inline uint32_t can_get(const uint8_t *data, uint32_t bytes) {
  uint32_t value = 0;
  for (uint32_t i = 0; i < bytes; i++) {
    value |= (uint32_t)data[i] << (8u * i);
  }
  return value;
}

static inline void can_put(uint8_t *data, uint32_t bytes, uint32_t value) {
  for (uint32_t i = 0; i < bytes; i++) {
    data[i] = (uint8_t)(value >> (8u * i));
  }
}

#endif
