// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Node-ID and bit rate in the SPI flash, beside the parameter block: for the CANopen node and for the loader.
#ifndef FL_CAN_SETUP_H
#define FL_CAN_SETUP_H

#include <stdbool.h>
#include <stdint.h>

// Node-ID (1..127) and kbit/s. false: not there or broken, setup is left as it is.
bool flash_can_setup(uint32_t setup[2]);

#endif
