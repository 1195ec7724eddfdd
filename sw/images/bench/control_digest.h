// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// What a host calls of the digests of control_digest.c.
#ifndef FL_CONTROL_DIGEST_H
#define FL_CONTROL_DIGEST_H

#include <stdint.h>

// Digest of a section (0 is the first) over so many rounds of random inputs; seed above 0.
uint32_t control_digest(uint32_t section, uint32_t seed, uint32_t rounds);

#endif
