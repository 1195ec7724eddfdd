// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "app/app.h"
#include "control/placement.h"
#include "hal/chip.h"
#include "hal/cpu.h"

SMALL_CODE_BEGIN

setting_result_t app_set(app_t *app, setting_t setting, int32_t value) {
  drive_t *drive = &app->drive;
  // The control step reads the settings: work on a copy, put it in place as a whole.
  settings_t next = drive->settings;
  const setting_result_t result = settings_set(&next, drive->p, setting, value);
  if (result != SETTING_TAKEN) {
    return result;
  }
  const uint32_t state = critical_enter();
  drive_set(drive, &next);
  critical_leave(state);
  if (setting == SETTING_IRQ_LOAD) {
    chip_set_load((uint32_t)value);
  }
  return SETTING_TAKEN;
}

SMALL_CODE_END
