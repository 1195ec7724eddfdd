// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// The CANopen node on the chip: CAN controller, clock, memory of the stored objects, all from the main loop.
//
// Node-ID and bit rate after power-up: of the SPI flash; where there is none, or it does not answer, from RAM_CAN_SETUP, two
// words, node-ID and kbit/s. Objects are stored in the flash (flash_store.h); on a chip without a port for one what 0x1010
// stores holds until power-down.
#ifndef FL_CHIP_NODE_H
#define FL_CHIP_NODE_H

#include "app/app.h"

// Boot the node and join the bus. The application must have booted.
void chip_node_init(app_t *app);
// One round of the main loop: at most one frame in, timers, frames out.
void chip_node_poll(void);

#endif
