// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "canopen/canopen.h"
#include "control/placement.h"

SMALL_CODE_BEGIN

bool canopen_send(canopen_t *node, uint32_t id, const uint8_t *data, uint32_t length, bool is_pdo) {
  can_frame_t frame = {.id = id, .length = (uint8_t)length};
  for (uint32_t i = 0; i < length; i++) {
    frame.data[i] = data[i];
  }
  const bool put = send_queue_put(&node->queue, &frame, is_pdo);
  node->value[OD_COUNTER_FRAMES_DROPPED] += put ? 0u : 1u;
  return put;
}

SMALL_CODE_END
