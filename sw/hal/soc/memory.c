// The two functions that a freestanding compiler may call for copying and clearing structures.
#include <stddef.h>
#include <stdint.h>

void *memcpy(void *restrict to, const void *restrict from, size_t length);
void *memset(void *to, int value, size_t length);

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
