// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Stored objects: two slots in non-volatile memory, written in turns, so that a save that is cut off loses nothing.
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

// Non-volatile memory with two slots of at least 4 * STORE_WORDS bytes. False: it failed.
typedef struct {
  void *context;
  bool (*read)(void *context, uint32_t slot, void *data, uint32_t bytes);
  bool (*write)(void *context, uint32_t slot, const void *data, uint32_t bytes);
} storage_t;

// Node-ID that the newest valid image asks for; 0: there is none.
uint32_t store_node_id(canopen_t *node);
// Take over the entries with first <= index <= last of the newest valid image. A value that is not in its range any
// more is left; COB-IDs stored under another node-ID too.
void store_load(canopen_t *node, uint32_t first, uint32_t last);
// Write into the other slot, read back. False: the memory failed, the older image holds.
bool store_save(canopen_t *node);
// Make both slots invalid, the newest image last.
bool store_forget(canopen_t *node);

#endif
