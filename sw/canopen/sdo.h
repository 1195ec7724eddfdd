// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// SDO server: expedited and segmented transfers, one at a time. A new request replaces a transfer that was left.
#ifndef FL_SDO_H
#define FL_SDO_H

#include <stdbool.h>
#include <stdint.h>

#include "hal/can_frame.h"
#include "canopen/dictionary.h"

typedef struct canopen canopen_t;

typedef enum { SDO_IDLE, SDO_UPLOAD, SDO_DOWNLOAD } sdo_transfer_t;

typedef struct {
  sdo_transfer_t transfer;
  uint32_t number;
  uint32_t toggle;
  uint32_t offset;  // bytes moved
  uint32_t length;  // of an upload; announced of a download, UINT32_MAX: not announced
  uint8_t data[OD_STRING_MAX];
} sdo_t;

void sdo_reset(canopen_t *node);
// A frame to the server.
void sdo_receive(canopen_t *node, const can_frame_t *frame);

#endif
