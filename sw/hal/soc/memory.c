// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// What a freestanding compiler may call: copying and clearing of structures, 64-bit shifts in code for size.
#include <stddef.h>
#include <stdint.h>

void *memcpy(void *restrict to, const void *restrict from, size_t length);
void *memset(void *to, int value, size_t length);
int64_t __ashldi3(int64_t x, int bits);
int64_t __lshrdi3(int64_t x, int bits);
int64_t __ashrdi3(int64_t x, int bits);

void *memcpy(void *restrict to, const void *restrict from, size_t length) {
  uint8_t *t = to;
  const uint8_t *f = from;
  if ((((uintptr_t)t | (uintptr_t)f) & 3u) == 0u) {
    for (; length >= 4u; length -= 4u) {
      *(uint32_t *)(void *)t = *(const uint32_t *)(const void *)f;
      t += 4;
      f += 4;
    }
  }
  for (; length > 0u; length--) {
    *t++ = *f++;
  }
  return to;
}

void *memset(void *to, int value, size_t length) {
  uint8_t *t = to;
  const uint8_t byte = (uint8_t)value;
  if (((uintptr_t)t & 3u) == 0u) {
    const uint32_t word = byte * 0x01010101u;
    for (; length >= 4u; length -= 4u) {
      *(uint32_t *)(void *)t = word;
      t += 4;
    }
  }
  for (; length > 0u; length--) {
    *t++ = byte;
  }
  return to;
}

static int64_t join(uint32_t high, uint32_t low) { return (int64_t)(((uint64_t)high << 32) | low); }

// 0 <= bits <= 63, in halves: the shift of the whole would call the function itself.
int64_t __ashldi3(int64_t x, int bits) {
  const uint32_t low = (uint32_t)x;
  const uint32_t high = (uint32_t)((uint64_t)x >> 32);
  if (bits >= 32) {
    return join(low << (bits - 32), 0);
  }
  return (bits == 0) ? x : join((high << bits) | (low >> (32 - bits)), low << bits);
}

int64_t __lshrdi3(int64_t x, int bits) {
  const uint32_t low = (uint32_t)x;
  const uint32_t high = (uint32_t)((uint64_t)x >> 32);
  if (bits >= 32) {
    return join(0, high >> (bits - 32));
  }
  return (bits == 0) ? x : join(high >> bits, (high << (32 - bits)) | (low >> bits));
}

int64_t __ashrdi3(int64_t x, int bits) {
  const uint32_t low = (uint32_t)x;
  const int32_t high = (int32_t)((uint64_t)x >> 32);
  if (bits >= 32) {
    return join((uint32_t)(high >> 31), (uint32_t)(high >> (bits - 32)));
  }
  return (bits == 0) ? x : join((uint32_t)(high >> bits), ((uint32_t)high << (32 - bits)) | (low >> bits));
}
