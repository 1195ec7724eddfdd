// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Stored objects of the node in the SPI flash of a chip with Boot: a sector for each image.
//
// A save erases both sectors: the caller waits some 100 ms, 2 s at most for one that ceases to answer meanwhile; interrupts
// go on.
// Flashes bear 100 000 of them a sector.
#ifndef FL_FLASH_STORE_H
#define FL_FLASH_STORE_H

#include "canopen/store.h"

// Memory of the stored objects, whether it answers or not; 0: the chip has no port for one.
const storage_t *flash_storage(void);

#endif
