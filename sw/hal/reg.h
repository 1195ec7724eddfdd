// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Register access. On the chip a plain 32-bit load or store; on a host a function of the simulated chip.
#ifndef FL_REG_H
#define FL_REG_H

#include <stddef.h>
#include <stdint.h>

#include "fluxlock_regs.h"

#define REG_BASE 0x80000000u
// Address of a register by its path in the map, for example REG(pwm.duty).
#define REG(path) (REG_BASE + (uint32_t)offsetof(fluxlock_regs_t, path))

// Bit of the block that a register belongs to in sys.blocks: each has a window of 4 KiB.
#define BLOCK_OF(path) (1u << ((REG(path) - REG_BASE) >> 12))

// Value shifted into a field. `field` is the generated name without suffix.
#define FIELD(field, value) (((uint32_t)(value) << field##_bp) & field##_bm)
// A field's bits out of a register value.
#define BITS(field, word) (((word) & field##_bm) >> field##_bp)

#if defined(FL_HOST)
uint32_t reg_read(uint32_t address);
void reg_write(uint32_t address, uint32_t value);
#else
static inline uint32_t reg_read(uint32_t address) { return *(const volatile uint32_t *)address; }
static inline void reg_write(uint32_t address, uint32_t value) { *(volatile uint32_t *)address = value; }
#endif

#endif
