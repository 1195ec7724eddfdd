// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// CRC-32 of IEEE 802.3 (reflected 0xEDB88320, start and final inversion), as zlib and Ethernet compute it.
#ifndef FL_CRC32_H
#define FL_CRC32_H

#include <stddef.h>
#include <stdint.h>

// Checksum of length bytes. Nibble table, about 20 clocks a byte.
uint32_t crc32(const uint8_t *data, size_t length);

#endif
