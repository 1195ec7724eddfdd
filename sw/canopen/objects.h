// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Values of the objects: reading, checking, writing, and what a write makes happen.
#ifndef FL_OBJECTS_H
#define FL_OBJECTS_H

#include <stdint.h>

#include "canopen/canopen.h"

// Value of a number, from the drive where it is live.
uint32_t objects_read(canopen_t *node, uint32_t number);
// SDO_OK, or why a write would be refused now. The value is extended (od_extend).
uint32_t objects_check(canopen_t *node, uint32_t number, uint32_t value);
// Write a value that passed the check; SDO_OK or an abort code of what it made happen.
uint32_t objects_write(canopen_t *node, uint32_t number, uint32_t value);

// Strings and domains: length in bytes, bytes from an offset on.
uint32_t objects_length(const canopen_t *node, uint32_t number);
void objects_bytes(const canopen_t *node, uint32_t number, uint32_t offset, uint8_t *data, uint32_t count);

// Defaults of the entries with first <= index <= last, and what the drive gives.
void objects_defaults(canopen_t *node, uint32_t first, uint32_t last);

#endif
