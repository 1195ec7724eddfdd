// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "drive/parameters.h"

#include <stdbool.h>
#include <stddef.h>

#include "control/crc32.h"
#include "hal/chip_io.h"

fault_t parameters_check(const parameter_block_t *block) {
  static const parameter_range_t ranges[] = PARAMETER_RANGES;
  static const uint8_t range_of[PARAMETER_VALUES] = PARAMETER_RANGE_OF;
  if (block->magic != PARAMETER_MAGIC) {
    return FAULT_PARAMETER_MAGIC;
  }
  // Without an injection its parameters, which are the last ones, may be left out: a boot of that much less time.
  const bool whole = block->length_bytes == sizeof(parameters_t);
  const uint32_t short_bytes = offsetof(parameters_t, injection);
  if (block->version != PARAMETER_VERSION || (!whole && block->length_bytes != short_bytes)) {
    return FAULT_PARAMETER_VERSION;
  }
  if (crc32((const uint8_t *)&block->parameters, block->length_bytes) != block->crc) {
    return FAULT_PARAMETER_CRC;
  }
  if (!whole && block->parameters.injection != 0) {
    return FAULT_PARAMETER_RANGE;
  }
  const int32_t *word = (const int32_t *)&block->parameters;
  const int32_t *end = word + block->length_bytes / sizeof(int32_t);
  for (uint32_t i = 0; word < end; i++) {
    const parameter_range_t *range = &ranges[range_of[i]];
    const bool is_gain = range->min > range->max;
    const int32_t low = is_gain ? range->max : range->min;
    const int32_t high = is_gain ? range->min : range->max;
    word += is_gain ? 1 : 0;
    if (*word < low || *word > high) {
      return FAULT_PARAMETER_RANGE;
    }
    word++;
  }
  return FAULT_NONE;
}
