// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// The parameter block as it lies in RAM: check before use.
#ifndef FL_PARAMETERS_H
#define FL_PARAMETERS_H

#include "drive/faults.h"
#include "params.h"

// FAULT_NONE, or the named fault of the first check that failed: magic, version with length, CRC, range of a word.
fault_t parameters_check(const parameter_block_t *block);

#endif
