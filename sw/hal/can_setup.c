// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "hal/can_setup.h"

#include "control/crc32.h"
#include "control/placement.h"
#include "hal/flash.h"
#include "ram.h"

SMALL_CODE_BEGIN

bool flash_can_setup(uint32_t setup[2]) {
  uint32_t found[3];
  flash_read(FLASH_CAN_SETUP, (uint8_t *)found, sizeof found);
  if (crc32((const uint8_t *)found, 8) != found[2] || found[0] < 1u || found[0] > 127u) {
    return false;
  }
  setup[0] = found[0];
  setup[1] = found[1];
  return true;
}

SMALL_CODE_END
