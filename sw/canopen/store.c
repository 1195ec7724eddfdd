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

// All of an image is there. Its magic is written last and may be damaged; 0: it is not to be taken.
static bool is_complete(const uint32_t *image) {
  return image[MAGIC] != 0u && image[LAYOUT] == OD_STORE_WORD && image[CRC] == checksum(image) &&
         image[LABEL_LENGTH] <= OD_STRING_MAX;
}

// The slot's image into store.image.
static slot_t read_slot(canopen_t *node, uint32_t slot) {
  const storage_t *storage = node->storage;
  uint32_t *image = node->store.image;
  if (storage == 0) {
    return SLOT_BLANK;
  }
  if (!storage->read(storage->context, slot, image, IMAGE_BYTES)) {
    return SLOT_SILENT;
  }
  if (image[MAGIC] == STORE_MAGIC && image[LAYOUT] != OD_STORE_WORD) {
    return SLOT_FOREIGN;
  }
  if (image[MAGIC] == STORE_MAGIC && is_complete(image)) {
    return SLOT_GOOD;
  }
  // Erased, forgotten, or never written.
  bool blank = image[0] == 0u || image[0] == UINT32_MAX;
  for (uint32_t i = 1; blank && i < STORE_WORDS; i++) {
    blank = image[i] == image[0];
  }
  return blank ? SLOT_BLANK : SLOT_BROKEN;
}

// A slot of which no image was taken held another one than that with this number: perhaps the newer one. A write that was
// cut off is none: it ends with the magic.
static bool held_another(canopen_t *node, uint32_t slot, uint32_t sequence) {
  uint32_t *image = node->store.image;
  const slot_t found = read_slot(node, slot);
  if (found == SLOT_SILENT) {
    return true;
  }
  const bool was_whole = image[MAGIC] == STORE_MAGIC || image[CRC] == checksum(image);
  if (found == SLOT_BLANK || image[MAGIC] == 0u || is_complete(image) || !was_whole) {
    return false;
  }
  // Its number may be what is damaged.
  const bool same = image[SEQUENCE] == sequence;
  image[SEQUENCE] = same ? sequence + 1u : sequence;
  return (image[CRC] == checksum(image)) == same;
}

// The newest good image into store.image; its slot, STORE_SLOTS: none.
static uint32_t read_newest(canopen_t *node) {
  store_t *store = &node->store;
  uint32_t newest = STORE_SLOTS;
  uint32_t sequence = 0;
  uint32_t copies = 0;
  bool blank = true;
  for (uint32_t slot = 0; slot < STORE_SLOTS; slot++) {
    store->slot[slot] = read_slot(node, slot);
    blank = blank && store->slot[slot] == SLOT_BLANK;
    const bool broken = store->slot[slot] == SLOT_BROKEN;
    if (store->slot[slot] != SLOT_GOOD && !(broken && is_complete(store->image))) {
      continue;
    }
    if (newest == STORE_SLOTS || (int32_t)(store->image[SEQUENCE] - sequence) > 0) {
      newest = slot;
      sequence = store->image[SEQUENCE];
      copies = 0;
    }
    copies += (store->image[SEQUENCE] == sequence && !broken) ? 1u : 0u;
  }
  const bool stale = newest != STORE_SLOTS && held_another(node, 1u - newest, sequence);
  if (newest != STORE_SLOTS && (read_slot(node, newest) == SLOT_SILENT || !is_complete(store->image))) {
    newest = STORE_SLOTS;
  }
  if (newest != STORE_SLOTS && !stale) {
    store->state = (copies == STORE_SLOTS) ? STORE_WHOLE : STORE_COPY;
  } else {
    store->state = blank ? STORE_EMPTY : STORE_LOST;
  }
  return newest;
}

static bool has_image(const canopen_t *node) {
  return node->store.state == STORE_WHOLE || node->store.state == STORE_COPY;
}

void store_read(canopen_t *node) {
  node->store.index = 0;
  (void)read_newest(node);
}

uint32_t store_node_id(const canopen_t *node) {
  if (!has_image(node)) {
    return 0;
  }
  uint32_t at = STORE_HEADER_WORDS;
  for (uint32_t n = 0; n < OD_DEVICE_NODE_ID; n++) {
    at += ((od_entry(n)->flags & OD_STORED) != 0u) ? 1u : 0u;
  }
  const uint32_t asked = node->store.image[at];
  return (od_check(OD_DEVICE_NODE_ID, asked) == SDO_OK) ? asked : 0u;
}

static void load_image(canopen_t *node, uint32_t first, uint32_t last) {
  const uint32_t *image = node->store.image;
  uint32_t at = STORE_HEADER_WORDS;
  for (uint32_t n = 0; n < OD_COUNT; n++) {
    const od_entry_t *entry = od_entry(n);
    if ((entry->flags & OD_STORED) == 0u) {
      continue;
    }
    const uint32_t value = image[at];
    at++;
    if (od_check(n, value) != SDO_OK) {
      node->store.index = (node->store.index != 0u) ? node->store.index : entry->index;
      node->store.state = STORE_LOST;
      continue;
    }
    const bool moved = (entry->flags & OD_NODE_RELATIVE) != 0u && image[NODE_ID] != node->node_id;
    if (entry->index >= first && entry->index <= last && !moved) {
      node->value[n] = value;
    }
  }
  if (first <= 0x2000u && last >= 0x2000u) {
    const uint8_t *label = (const uint8_t *)&image[LABEL];
    node->label_length = image[LABEL_LENGTH];
    for (uint32_t i = 0; i < OD_STRING_MAX; i++) {
      node->label[i] = label[i];
    }
  }
}

// CAN-IDs that are taken, of what is stored or was kept, have their defaults.
static void check_ids(canopen_t *node) {
  for (uint32_t n = pdo_id_taken(node); n != OD_COUNT; n = pdo_id_taken(node)) {
    node->store.index = (node->store.index != 0u) ? node->store.index : od_entry(n)->index;
    node->store.state = STORE_LOST;
    node->value[n] = od_default(n, node->node_id);
  }
}

// The bit rate beside the parameters, if it is none: the node is on the bus, by the stored one or the default.
static void check_setup(canopen_t *node) {
  if (node->bit_rate_kbit_s != 0u && od_check(OD_DEVICE_BIT_RATE, node->bit_rate_kbit_s) != SDO_OK) {
    node->store.index = (node->store.index != 0u) ? node->store.index : 0x2000u;
    node->store.state = has_image(node) ? STORE_COPY : STORE_LOST;
  }
}

void store_load(canopen_t *node, uint32_t first, uint32_t last) {
  if (has_image(node)) {
    load_image(node, first, last);
    check_ids(node);
  }
  check_setup(node);
  for (uint32_t n = 0; n < OD_COUNT && node->store.state == STORE_LOST; n++) {
    const od_entry_t *entry = od_entry(n);
    if ((entry->flags & OD_LIMIT) != 0u && entry->index >= first && entry->index <= last) {
      node->value[n] = entry->min;
    }
  }
}

void store_tell(canopen_t *node) {
  const store_t *store = &node->store;
  const uint32_t detail = (uint32_t)store->slot[0] | (uint32_t)store->slot[1] << 8 | store->index << 16;
  if (store->state == STORE_LOST) {
    emcy_set(node, EMCY_STORE_LOST, detail);
  } else {
    emcy_clear(node, EMCY_STORE_LOST);
  }
  if (store->state == STORE_COPY) {
    emcy_set(node, EMCY_STORE_COPY, detail);
  } else {
    emcy_clear(node, EMCY_STORE_COPY);
  }
}

static bool write_slot(canopen_t *node, uint32_t slot, uint32_t sequence) {
  const storage_t *storage = node->storage;
  return storage->write(storage->context, slot, node->store.image, IMAGE_BYTES) &&
         read_slot(node, slot) == SLOT_GOOD && node->store.image[SEQUENCE] == sequence;
}

bool store_save(canopen_t *node) {
  if (node->storage == 0) {
    return false;
  }
  const uint32_t newest = read_newest(node);
  uint32_t *image = node->store.image;
  const uint32_t sequence = (newest == STORE_SLOTS) ? 0u : image[SEQUENCE] + 1u;
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
  // The newest one stays until its successor is whole.
  const uint32_t first = (newest == 0u) ? 1u : 0u;
  const bool done = write_slot(node, first, sequence) && write_slot(node, 1u - first, sequence);
  store_read(node);
  store_tell(node);
  return done;
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
      node->store.image[i] = 0;
    }
    done = storage->write(storage->context, slot, node->store.image, IMAGE_BYTES) &&
           read_slot(node, slot) == SLOT_BLANK && done;
  }
  store_read(node);
  store_tell(node);
  return done;
}

SMALL_CODE_END
