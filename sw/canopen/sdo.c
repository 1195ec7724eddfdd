// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "canopen/sdo.h"

#include "canopen/abort.h"
#include "canopen/canopen.h"
#include "canopen/objects.h"

// Command specifiers of the client, data[0] >> 5.
enum { DOWNLOAD_SEGMENT = 0, DOWNLOAD = 1, UPLOAD = 2, UPLOAD_SEGMENT = 3, ABORT = 4 };
#define SEGMENT_BYTES 7u
#define NOT_ANNOUNCED UINT32_MAX

void sdo_reset(canopen_t *node) { node->sdo = (sdo_t){.transfer = SDO_IDLE}; }

static void answer(canopen_t *node, const uint8_t data[8]) {
  (void)canopen_send(node, 0x580u + node->node_id, data, 8, false);
}

// A request that is not refused, a read too, is a master that is there.
static void agree(canopen_t *node, const uint8_t data[8]) {
  drive_heard(&node->app->drive);
  answer(node, data);
}

static void answer_place(canopen_t *node, uint32_t command, uint32_t number, uint32_t value) {
  uint8_t data[8];
  data[0] = (uint8_t)command;
  can_put(&data[1], 2, od_entry(number)->index);
  data[3] = od_entry(number)->sub;
  can_put(&data[4], 4, value);
  agree(node, data);
}

static void abort_at(canopen_t *node, const uint8_t place[3], uint32_t code) {
  uint8_t data[8] = {0x80, place[0], place[1], place[2]};
  can_put(&data[4], 4, code);
  node->sdo.transfer = SDO_IDLE;
  node->value[OD_COUNTER_SDO_ABORTS]++;
  answer(node, data);
}

static void abort_transfer(canopen_t *node, uint32_t code) {
  const od_entry_t *entry = od_entry(node->sdo.number);
  const uint8_t place[3] = {(uint8_t)entry->index, (uint8_t)(entry->index >> 8), entry->sub};
  abort_at(node, place, code);
}

static uint32_t put_string(canopen_t *node, const uint8_t *data, uint32_t length) {
  for (uint32_t i = 0; i < length; i++) {
    node->label[i] = data[i];
  }
  node->label_length = length;
  return SDO_OK;
}

// The whole value has come. Of the objects with bytes only the label can be written.
static uint32_t put(canopen_t *node, uint32_t number, const uint8_t *data, uint32_t length) {
  const uint32_t bytes = od_bytes(number);
  if (bytes == 0u) {
    return put_string(node, data, length);
  }
  if (length != bytes) {
    return (length > bytes) ? SDO_TOO_LONG : SDO_TOO_SHORT;
  }
  const uint32_t value = od_extend(number, can_get(data, bytes));
  const uint32_t abort = objects_check(node, number, value);
  return (abort == SDO_OK) ? objects_write(node, number, value) : abort;
}

static uint32_t longest(uint32_t number) { return (od_bytes(number) != 0u) ? od_bytes(number) : OD_STRING_MAX; }

static uint32_t download(canopen_t *node, uint32_t number, const uint8_t *data) {
  sdo_t *sdo = &node->sdo;
  const bool expedited = (data[0] & 2u) != 0u;
  const bool sized = (data[0] & 1u) != 0u;
  if ((od_entry(number)->flags & OD_WRITE) == 0u) {
    return SDO_READ_ONLY;
  }
  if (expedited) {
    const uint32_t whole = (od_bytes(number) != 0u) ? od_bytes(number) : 4u;
    const uint32_t length = sized ? 4u - (data[0] >> 2 & 3u) : whole;
    return put(node, number, &data[4], length);
  }
  const uint32_t length = sized ? can_get(&data[4], 4) : NOT_ANNOUNCED;
  if (sized && length > longest(number)) {
    return SDO_TOO_LONG;
  }
  if (sized && length < od_bytes(number)) {
    return SDO_TOO_SHORT;
  }
  sdo->transfer = SDO_DOWNLOAD;
  sdo->number = number;
  sdo->toggle = 0;
  sdo->offset = 0;
  sdo->length = length;
  return SDO_OK;
}

static void download_segment(canopen_t *node, const uint8_t *data) {
  sdo_t *sdo = &node->sdo;
  const uint32_t toggle = data[0] >> 4 & 1u;
  const uint32_t length = SEGMENT_BYTES - (data[0] >> 1 & 7u);
  const bool last = (data[0] & 1u) != 0u;
  if (toggle != sdo->toggle) {
    abort_transfer(node, SDO_TOGGLE);
    return;
  }
  const uint32_t most = (sdo->length < longest(sdo->number)) ? sdo->length : longest(sdo->number);
  if (length > most - sdo->offset) {
    abort_transfer(node, SDO_TOO_LONG);
    return;
  }
  for (uint32_t i = 0; i < length; i++) {
    sdo->data[sdo->offset + i] = data[1u + i];
  }
  sdo->offset += length;
  if (last) {
    const bool cut = sdo->length != NOT_ANNOUNCED && sdo->offset < sdo->length;
    const uint32_t abort = cut ? SDO_TOO_SHORT : put(node, sdo->number, sdo->data, sdo->offset);
    if (abort != SDO_OK) {
      abort_transfer(node, abort);
      return;
    }
    sdo->transfer = SDO_IDLE;
  }
  const uint8_t reply[8] = {(uint8_t)(0x20u | toggle << 4)};
  sdo->toggle ^= 1u;
  agree(node, reply);
}

static uint32_t upload(canopen_t *node, uint32_t number) {
  sdo_t *sdo = &node->sdo;
  const uint32_t bytes = od_bytes(number);
  if (bytes != 0u) {
    const uint32_t value = objects_read(node, number);
    const uint32_t mask = (bytes == 4u) ? UINT32_MAX : (1u << (8u * bytes)) - 1u;
    answer_place(node, 0x43u | (4u - bytes) << 2, number, value & mask);
    return SDO_OK;
  }
  const uint32_t length = objects_length(node, number);
  if (length == 0u && od_entry(number)->type == OD_DOMAIN) {
    return SDO_NO_DATA;
  }
  sdo->transfer = SDO_UPLOAD;
  sdo->number = number;
  sdo->toggle = 0;
  sdo->offset = 0;
  sdo->length = length;
  answer_place(node, 0x41, number, length);
  return SDO_OK;
}

static void upload_segment(canopen_t *node, const uint8_t *request) {
  sdo_t *sdo = &node->sdo;
  const uint32_t toggle = request[0] >> 4 & 1u;
  if (toggle != sdo->toggle) {
    abort_transfer(node, SDO_TOGGLE);
    return;
  }
  const uint32_t left = sdo->length - sdo->offset;
  const uint32_t count = (left < SEGMENT_BYTES) ? left : SEGMENT_BYTES;
  // A capture that was armed anew has no records any more.
  if (objects_length(node, sdo->number) != sdo->length) {
    abort_transfer(node, SDO_NO_DATA);
    return;
  }
  uint8_t data[8] = {0};
  objects_bytes(node, sdo->number, sdo->offset, &data[1], count);
  data[0] = (uint8_t)(toggle << 4 | (SEGMENT_BYTES - count) << 1 | ((left <= SEGMENT_BYTES) ? 1u : 0u));
  sdo->offset += count;
  sdo->toggle ^= 1u;
  if (left <= SEGMENT_BYTES) {
    sdo->transfer = SDO_IDLE;
  }
  agree(node, data);
}

static void initiate(canopen_t *node, const uint8_t *data) {
  node->sdo.transfer = SDO_IDLE;
  uint32_t abort = SDO_OK;
  const uint32_t number = od_find(can_get(&data[1], 2), data[3], &abort);
  if (number != OD_COUNT && data[0] >> 5 == UPLOAD) {
    abort = upload(node, number);
  } else if (number != OD_COUNT) {
    abort = download(node, number, data);
    if (abort == SDO_OK) {
      answer_place(node, 0x60, number, 0);
    }
  }
  if (abort != SDO_OK) {
    abort_at(node, &data[1], abort);
  }
}

void sdo_receive(canopen_t *node, const can_frame_t *frame) {
  const uint8_t *data = frame->data;
  if (frame->length != 8u) {
    // The standard knows eight bytes only; what is missing of the place counts as 0.
    const uint8_t place[3] = {(frame->length > 1u) ? data[1] : 0u, (frame->length > 2u) ? data[2] : 0u,
                              (frame->length > 3u) ? data[3] : 0u};
    abort_at(node, place, SDO_COMMAND);
    return;
  }
  const uint32_t command = data[0] >> 5;
  if (command == DOWNLOAD || command == UPLOAD) {
    initiate(node, data);
  } else if (command == DOWNLOAD_SEGMENT && node->sdo.transfer == SDO_DOWNLOAD) {
    download_segment(node, data);
  } else if (command == UPLOAD_SEGMENT && node->sdo.transfer == SDO_UPLOAD) {
    upload_segment(node, data);
  } else if (command == ABORT) {
    node->sdo.transfer = SDO_IDLE;
  } else {
    abort_at(node, &data[1], SDO_COMMAND);
  }
}
