// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// The two zlib functions that Verilator's FST writer calls, so that `--waves` needs no system library.
// The writer's large input is the time table, one byte an edge, nearly always the same: runs are all that is coded.
// Format: RFC 1950 and 1951, one block with fixed codes; a run is a match of 258 bytes at distance 1.
#pragma once
#include <cstdint>
#include <initializer_list>

typedef unsigned char Bytef;
typedef unsigned long uLong;
typedef unsigned long uLongf;
constexpr int Z_OK = 0;

inline uLong compressBound(uLong size) { return size + size / 8 + 16; }  // 9 bits for a literal

// dst must hold compressBound(size) bytes.
inline int compress2(Bytef* dst, uLongf* written, const Bytef* src, uLong size, int /*level*/) {
    constexpr uLong RUN = 258;
    Bytef* out = dst;
    uint32_t bits = 0, count = 0;
    const auto put = [&](uint32_t value, uint32_t n) {  // least significant bit first
        bits |= value << count;
        for (count += n; count >= 8; count -= 8, bits >>= 8) *out++ = static_cast<Bytef>(bits);
    };
    const auto code = [&](uint32_t value, uint32_t n) {  // Huffman codes: most significant bit first
        while (n--) put(value >> n & 1, 1);
    };
    *out++ = 0x78, *out++ = 0x01;  // deflate, window of 32 KiB
    put(0b011, 3);                 // last block, fixed codes
    for (uLong i = 0; i < size;) {
        uLong run = 0;
        while (i && run < RUN && i + run < size && src[i + run] == src[i - 1]) run++;
        if (run == RUN) {
            code(0xC0 + 5, 8), code(0, 5);  // length symbol 285, distance symbol 0
            i += RUN;
        } else {
            if (src[i] < 144) code(0x30u + src[i], 8);
            else code(0x190u + src[i] - 144, 9);
            i++;
        }
    }
    code(0, 7), put(0, 7);  // end of block, filled up to a byte
    uint32_t a = 1, b = 0;  // Adler-32
    for (uLong i = 0; i < size; i++) a = (a + src[i]) % 65521, b = (b + a) % 65521;
    for (const uint32_t half : {b, a}) *out++ = static_cast<Bytef>(half >> 8), *out++ = static_cast<Bytef>(half);
    *written = static_cast<uLongf>(out - dst);
    return Z_OK;
}
