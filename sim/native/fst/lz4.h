// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// The two LZ4 functions that Verilator's FST writer calls, so that `--waves` needs no system library.
// Format: LZ4 block. A greedy search with one table of the last position of every hash.
#pragma once
#include <cstdint>
#include <cstring>
#include <vector>

inline int LZ4_compressBound(int size) { return size + size / 255 + 16; }

// dst must hold LZ4_compressBound(size) bytes.
inline int LZ4_compress_default(const char* src, char* dst, int size, int /*capacity*/) {
    constexpr int MIN_MATCH = 4, END_LITERALS = 5, END_MARGIN = 12, MAX_OFFSET = 65535;  // of the format
    constexpr int HASH_BITS = 14;
    std::vector<int> last(1 << HASH_BITS, -MAX_OFFSET - 1);
    char* out = dst;
    const auto length = [&](int n) {  // what does not fit into its nibble of the token
        if (n < 15) return;
        for (n -= 15; n >= 255; n -= 255) *out++ = static_cast<char>(255);
        *out++ = static_cast<char>(n);
    };
    const auto literals = [&](int from, int to, int match_code) {  // the token and what is copied as it is
        const int n = to - from;
        *out++ = static_cast<char>((n < 15 ? n : 15) << 4 | (match_code < 15 ? match_code : 15));
        length(n);
        if (n) memcpy(out, src + from, static_cast<size_t>(n));
        out += n;
    };
    int anchor = 0;
    for (int i = 0; i < size - END_MARGIN;) {
        uint32_t word, seen;
        memcpy(&word, src + i, 4);
        int& slot = last[(word * 2654435761u) >> (32 - HASH_BITS)];
        const int match = slot;
        slot = i;
        if (i - match <= MAX_OFFSET) memcpy(&seen, src + match, 4);
        if (i - match > MAX_OFFSET || seen != word) {
            i++;
            continue;
        }
        int n = MIN_MATCH;
        while (i + n < size - END_LITERALS && src[match + n] == src[i + n]) n++;
        literals(anchor, i, n - MIN_MATCH);
        *out++ = static_cast<char>((i - match) & 255);
        *out++ = static_cast<char>((i - match) >> 8);
        length(n - MIN_MATCH);
        anchor = i += n;
    }
    literals(anchor, size, 0);
    return static_cast<int>(out - dst);
}
