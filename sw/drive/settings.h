// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// What may change while the drive runs: settings.toml has the table. Every setting has a number, in the unit of people.
#ifndef FL_SETTINGS_H
#define FL_SETTINGS_H

#include "params.h"
#include "settings_table.h"

typedef enum { SETTING_TAKEN, SETTING_OUT_OF_RANGE, SETTING_OF_OTHER_METHOD } setting_result_t;

// Flags: bits of the methods that know it, by method_t.
enum { SETTING_METHODS = 3u, SETTING_THOUSANDTHS = 4u, SETTING_OR_ZERO = 8u };

// One row of the table.
typedef struct {
  const char *name;
  const char *const *choices;  // words, min..max; 0: a number
  int32_t min;
  int32_t max;
  uint16_t parameter;  // that it begins with, word of the block
  uint8_t offset;      // of the member of settings_t
  uint8_t size;
  uint8_t flags;
} setting_row_t;

const setting_row_t *setting_row(setting_t setting);
// Whether the method of the parameters knows it.
bool setting_is_known(const parameters_t *p, setting_t setting);

// The settings that the parameters say.
void settings_init(settings_t *s, const parameters_t *p);
int32_t settings_get(const settings_t *s, const parameters_t *p, setting_t setting);
// Checks and converts; what is not taken changes nothing.
setting_result_t settings_set(settings_t *s, const parameters_t *p, setting_t setting, int32_t value);

// Current in the format of the samples, 0 below zero, at most full scale; and back.
int32_t current_q17_of_ma(const parameters_t *p, int32_t milliamp);
int32_t current_ma_of_q17(const parameters_t *p, int32_t i_q17);
int32_t torque_unm_of_current(const parameters_t *p, int32_t i_q25);

#endif
