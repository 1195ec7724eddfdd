// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "canopen/store.h"

#include "canopen/abort.h"
#include "canopen/canopen.h"
#include "control/crc32.h"
#include "control/placement.h"

SMALL_CODE_BEGIN

enum { MAGIC = 0, LAYOUT = 1, CRC = 2, SEQUENCE = 3, NODE_ID = 4 };
#define IMAGE_BYTES (4u * STORE_WORDS)
#define LABEL_LENGTH (STORE_HEADER_WORDS + OD_STORED_COUNT)
#define LABEL (LABEL_LENGTH + 1u)

static uint32_t checksum(const uint32_t *image) {
  return crc32((const uint8_t *)&image[SEQUENCE], 4u * (STORE_WORDS - SEQUENCE));
}

// The slot's image into node->image; false: none, or none of this firmware.
static bool read_slot(canopen_t *node, uint32_t slot) {
  const storage_t *storage = node->storage;
  uint32_t *image = node->image;
  return storage != 0 && storage->read(storage->context, slot, image, IMAGE_BYTES) && image[MAGIC] == STORE_MAGIC &&
         image[LAYOUT] == OD_STORE_WORD && image[CRC] == checksum(image) && image[LABEL_LENGTH] <= OD_STRING_MAX;
}

// The newest image into node->image; its slot, STORE_SLOTS: none.
static uint32_t read_newest(canopen_t *node) {
  uint32_t newest = STORE_SLOTS;
  uint32_t sequence = 0;
  for (uint32_t slot = 0; slot < STORE_SLOTS; slot++) {
    if (read_slot(node, slot) && (newest == STORE_SLOTS || (int32_t)(node->image[SEQUENCE] - sequence) > 0)) {
      newest = slot;
      sequence = node->image[SEQUENCE];
    }
  }
  if (newest != STORE_SLOTS && !read_slot(node, newest)) {
    return STORE_SLOTS;
  }
  return newest;
}

uint32_t store_node_id(canopen_t *node) {
  if (read_newest(node) == STORE_SLOTS) {
    return 0;
  }
  uint32_t at = STORE_HEADER_WORDS;
  for (uint32_t n = 0; n < OD_DEVICE_NODE_ID; n++) {
    at += ((od_entry(n)->flags & OD_STORED) != 0u) ? 1u : 0u;
  }
  return (od_check(OD_DEVICE_NODE_ID, node->image[at]) == SDO_OK) ? node->image[at] : 0u;
}

void store_load(canopen_t *node, uint32_t first, uint32_t last) {
  if (read_newest(node) == STORE_SLOTS) {
    return;
  }
  const uint32_t *image = node->image;
  uint32_t at = STORE_HEADER_WORDS;
  for (uint32_t n = 0; n < OD_COUNT; n++) {
    const od_entry_t *entry = od_entry(n);
    if ((entry->flags & OD_STORED) == 0u) {
      continue;
    }
    const bool moved = (entry->flags & OD_NODE_RELATIVE) != 0u && image[NODE_ID] != node->node_id;
    const bool wanted = entry->index >= first && entry->index <= last;
    if (wanted && !moved && od_check(n, image[at]) == SDO_OK) {
      node->value[n] = image[at];
    }
    at++;
  }
  if (first <= 0x2000u && last >= 0x2000u) {
    const uint8_t *label = (const uint8_t *)&image[LABEL];
    node->label_length = image[LABEL_LENGTH];
    for (uint32_t i = 0; i < OD_STRING_MAX; i++) {
      node->label[i] = label[i];
    }
  }
}

bool store_save(canopen_t *node) {
  const storage_t *storage = node->storage;
  if (storage == 0) {
    return false;
  }
  const uint32_t newest = read_newest(node);
  uint32_t *image = node->image;
  const uint32_t sequence = (newest == STORE_SLOTS) ? 0u : image[SEQUENCE] + 1u;
  const uint32_t slot = (newest == 0u) ? 1u : 0u;
  image[MAGIC] = STORE_MAGIC;
  image[LAYOUT] = OD_STORE_WORD;
  image[SEQUENCE] = sequence;
  image[NODE_ID] = node->node_id;
  uint32_t at = STORE_HEADER_WORDS;
  for (uint32_t n = 0; n < OD_COUNT; n++) {
    if ((od_entry(n)->flags & OD_STORED) != 0u) {
      image[at] = node->value[n];
      at++;
    }
  }
  image[LABEL_LENGTH] = node->label_length;
  for (uint32_t i = 0; i < OD_STRING_MAX / 4u; i++) {
    image[LABEL + i] = can_get(&node->label[4u * i], 4);
  }
  image[CRC] = checksum(image);
  return storage->write(storage->context, slot, image, IMAGE_BYTES) && read_slot(node, slot) &&
         image[SEQUENCE] == sequence;
}

bool store_forget(canopen_t *node) {
  const storage_t *storage = node->storage;
  if (storage == 0) {
    return false;
  }
  // The newest one last: cut off between the two, it holds on, and not the one that it replaced.
  const uint32_t last = (read_newest(node) == 0u) ? 0u : 1u;
  bool done = true;
  for (uint32_t k = 0; k < STORE_SLOTS; k++) {
    const uint32_t slot = (k == 0u) ? 1u - last : last;
    for (uint32_t i = 0; i < STORE_WORDS; i++) {
      node->image[i] = 0;
    }
    done = storage->write(storage->context, slot, node->image, IMAGE_BYTES) && !read_slot(node, slot) && done;
  }
  return done;
}

SMALL_CODE_END
