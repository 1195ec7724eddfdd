// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// The named values of the console: what can be read, what can be set, in the units of people.
#ifndef FL_CONSOLE_ITEMS_H
#define FL_CONSOLE_ITEMS_H

#include "app/app.h"
#include "console/line.h"

// Print `name value` as a reply of the line; false: no such name.
bool items_print(const app_t *app, line_t *line, const char *name);
const char *items_print_all(const app_t *app, line_t *line);
// Set a value; 0 or the text of the error. Acts on a whole setting at once, at the next control tick.
const char *items_set(app_t *app, const char *name, const char *value);
// Names that can be set, each after a blank.
void items_list_settable(const app_t *app, line_t *line);

#endif
