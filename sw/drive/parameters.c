#include "drive/parameters.h"

#include <stdbool.h>

#include "control/crc32.h"

fault_t parameters_check(const parameter_block_t *block) {
  static const parameter_range_t ranges[PARAMETER_VALUES] = PARAMETER_RANGES;
  if (block->magic != PARAMETER_MAGIC) {
    return FAULT_PARAMETER_MAGIC;
  }
  if (block->version != PARAMETER_VERSION || block->length_bytes != sizeof(parameters_t)) {
    return FAULT_PARAMETER_VERSION;
  }
  if (crc32((const uint8_t *)&block->parameters, sizeof(parameters_t)) != block->crc) {
    return FAULT_PARAMETER_CRC;
  }
  const int32_t *word = (const int32_t *)&block->parameters;
  for (uint32_t i = 0; i < PARAMETER_VALUES; i++) {
    const bool is_gain = ranges[i].min > ranges[i].max;
    const int32_t low = is_gain ? ranges[i].max : ranges[i].min;
    const int32_t high = is_gain ? ranges[i].min : ranges[i].max;
    word += is_gain ? 1 : 0;
    if (*word < low || *word > high) {
      return FAULT_PARAMETER_RANGE;
    }
    word++;
  }
  return FAULT_NONE;
}
