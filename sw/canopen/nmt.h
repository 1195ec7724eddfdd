// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Network management slave, heartbeat producer, heartbeat consumers.
#ifndef FL_NMT_H
#define FL_NMT_H

#include <stdbool.h>
#include <stdint.h>

#include "hal/can_frame.h"
#include "canopen/timer.h"

typedef struct canopen canopen_t;

#define NMT_CONSUMERS 4u

// As in the heartbeat.
typedef enum { NMT_BOOT_UP = 0, NMT_STOPPED = 4, NMT_OPERATIONAL = 5, NMT_PRE_OPERATIONAL = 127 } nmt_state_t;

// What a command asks of the node as a whole.
typedef enum { NMT_NO_RESET, NMT_RESET_COMMUNICATION, NMT_RESET_NODE } nmt_wish_t;

typedef struct {
  nmt_state_t state;
  bool boot_told;
  span_t heartbeat;
  span_t watch[NMT_CONSUMERS];  // runs from the first heartbeat of the watched node on
} nmt_t;

// Pre-operational, with the boot-up frame to be sent.
void nmt_reset(canopen_t *node);
// The frame with CAN-ID 0.
nmt_wish_t nmt_command(canopen_t *node, const can_frame_t *frame);
// A heartbeat or boot-up frame of another node.
void nmt_heartbeat(canopen_t *node, uint32_t id);
// Whether a heartbeat of another node is watched.
bool nmt_watches(const canopen_t *node);
// The k-th consumer entry has changed: it waits for a first heartbeat.
void nmt_watch(canopen_t *node, uint32_t k);
void nmt_step(canopen_t *node);
// A communication error: NMT state by 0x1029, drive by 0x6007.
void nmt_communication_error(canopen_t *node, uint32_t code);

#endif
