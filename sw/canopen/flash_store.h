// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Stored objects of the node in the SPI flash of a chip with Boot: a sector for each image.
//
// A save erases a sector: the caller waits some 50 ms, at most 2 s if the flash does not answer, while interrupts go on.
// Flashes bear 100 000 of them a sector.
#ifndef FL_FLASH_STORE_H
#define FL_FLASH_STORE_H

#include "canopen/store.h"

// Memory of the stored objects; 0: no flash answers.
const storage_t *flash_storage(void);

#endif
