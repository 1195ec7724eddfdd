// What of the node lies in the SPI flash of a chip with Boot: a sector for each image of stored objects, and node-ID and
// bit rate beside the parameter block.
//
// A save erases a sector: the caller waits some 50 ms, at most 2 s if the flash does not answer, while interrupts go on.
// Flashes bear 100 000 of them a sector.
#ifndef FL_FLASH_STORE_H
#define FL_FLASH_STORE_H

#include <stdbool.h>
#include <stdint.h>

#include "canopen/store.h"

// Memory of the stored objects; 0: no flash answers.
const storage_t *flash_storage(void);
// Node-ID (1..127) and kbit/s. false: not there or broken, setup is left as it is.
bool flash_can_setup(uint32_t setup[2]);

#endif
