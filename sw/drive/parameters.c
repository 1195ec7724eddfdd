#include "drive/parameters.h"

#include "control/crc32.h"

fault_t parameters_check(const parameter_block_t *block) {
  static const parameter_range_t ranges[PARAMETER_WORDS] = PARAMETER_RANGES;
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
  for (uint32_t i = 0; i < PARAMETER_WORDS; i++) {
    if (word[i] < ranges[i].min || word[i] > ranges[i].max) {
      return FAULT_PARAMETER_RANGE;
    }
  }
  return FAULT_NONE;
}
