// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Frames on their way to the driver, first in, first out. The last places are kept for what is not a PDO.
#ifndef FL_SEND_QUEUE_H
#define FL_SEND_QUEUE_H

#include <stdbool.h>

#include "hal/can_frame.h"

#define SEND_QUEUE_LENGTH 16u
#define SEND_QUEUE_KEPT 4u

typedef struct {
  can_frame_t frame[SEND_QUEUE_LENGTH];
  uint32_t head;  // frames put in since the reset
  uint32_t tail;  // taken out
} send_queue_t;

static inline bool send_queue_put(send_queue_t *queue, const can_frame_t *frame, bool is_pdo) {
  const uint32_t room = SEND_QUEUE_LENGTH - (queue->head - queue->tail);
  if (room <= (is_pdo ? SEND_QUEUE_KEPT : 0u)) {
    return false;
  }
  queue->frame[queue->head % SEND_QUEUE_LENGTH] = *frame;
  queue->head++;
  return true;
}

static inline bool send_queue_take(send_queue_t *queue, can_frame_t *frame) {
  if (queue->head == queue->tail) {
    return false;
  }
  *frame = queue->frame[queue->tail % SEND_QUEUE_LENGTH];
  queue->tail++;
  return true;
}

#endif
