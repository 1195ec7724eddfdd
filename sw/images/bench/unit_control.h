// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// What a host calls of the unit tests of unit_control.c.
#ifndef FL_UNIT_CONTROL_H
#define FL_UNIT_CONTROL_H

#include <stdint.h>

// Run all; number of tests that failed.
uint32_t unit_control(void);

// What they have written since the last call.
const char *unit_report(void);

#endif
