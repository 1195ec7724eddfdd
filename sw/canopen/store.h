// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Stored objects: the same image in two slots of non-volatile memory. A save that is cut off loses nothing, and neither
// does a slot that breaks. What is stored and cannot be read is an error and never its default.
//
// Image, little-endian words: magic, layout (version and checksum of what is stored), CRC-32 of all that follows it,
// sequence number, node-ID at the time, values in the order of the dictionary, length of the label, label.
#ifndef FL_STORE_H
#define FL_STORE_H

#include <stdbool.h>
#include <stdint.h>

#include "canopen/dictionary.h"

typedef struct canopen canopen_t;

#define STORE_MAGIC 0x4F584C46u  // "FLXO"
#define STORE_HEADER_WORDS 5u
#define STORE_WORDS (STORE_HEADER_WORDS + OD_STORED_COUNT + 1u + OD_STRING_MAX / 4u)
#define STORE_SLOTS 2u

// Non-volatile memory with two slots of at least 4 * STORE_WORDS bytes. A write takes the magic, its first word, away
// before anything else and writes it last, so that one that is cut off is known. False: it does not answer, or a write
// failed.
typedef struct {
  void *context;
  bool (*read)(void *context, uint32_t slot, void *data, uint32_t bytes);
  bool (*write)(void *context, uint32_t slot, const void *data, uint32_t bytes);
} storage_t;

// Foreign: of another layout. Silent: the memory does not answer.
typedef enum { SLOT_BLANK, SLOT_GOOD, SLOT_FOREIGN, SLOT_BROKEN, SLOT_SILENT } slot_t;

typedef enum {
  STORE_EMPTY,  // nothing is stored
  STORE_WHOLE,
  STORE_COPY,  // one slot holds it, the other one is older, blank, cut off or a broken copy of it
  STORE_LOST,  // something is stored, or may be, and it or a value of it cannot be taken
} store_state_t;

typedef struct {
  store_state_t state;
  slot_t slot[STORE_SLOTS];
  uint32_t index;  // of the first stored object whose value is not allowed; 0: none
  uint32_t image[STORE_WORDS];
} store_t;

// Read the newest good image into store.image.
void store_read(canopen_t *node);
// Node-ID that the image asks for; 0: none.
uint32_t store_node_id(const canopen_t *node);
// Take over the entries with first <= index <= last of the image. COB-IDs stored under another node-ID keep their
// defaults. Where the store is lost the objects marked `limit` have their least values.
void store_load(canopen_t *node, uint32_t first, uint32_t last);
// Tell by EMCY what is lost or has no copy.
void store_tell(canopen_t *node);
// Write into both slots, read back. False: the memory failed, at least one slot holds the older or the newer image.
bool store_save(canopen_t *node);
// Make both slots blank, the newest image last.
bool store_forget(canopen_t *node);

#endif
