// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Waiting by the chip's free-running counter: for the loader, and for the flash.
#ifndef FL_WAIT_H
#define FL_WAIT_H

#include <stdbool.h>
#include <stdint.h>

#include "hal/reg.h"

#define CLOCKS_PER_MS 50000u

static inline uint32_t wait_now(void) { return reg_read(REG(sys.time_now)); }

// Whether `ms` milliseconds, at most 85 s, have passed since `start`.
static inline bool wait_over(uint32_t start, uint32_t ms) { return wait_now() - start >= ms * CLOCKS_PER_MS; }

#endif
