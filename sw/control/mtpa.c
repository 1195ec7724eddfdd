// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/mtpa.h"

#include "control/placement.h"
#include "control/trig.h"

SMALL_CODE_BEGIN

SHARED complex_t mtpa_current_i_q25(int32_t amplitude_i_q25, int32_t ratio_i_q25) {
  if (ratio_i_q25 == 0 || amplitude_i_q25 == 0) {
    return (complex_t){0, amplitude_i_q25};
  }
  const uint32_t ratio = (uint32_t)abs_sat(ratio_i_q25);
  const uint64_t square = (uint64_t)((int64_t)amplitude_i_q25 * amplitude_i_q25);
  const uint32_t root = sqrt_u64((uint64_t)ratio * ratio + 8u * square);
  const int32_t weaken = (int32_t)div_sat_u32(2u * square, ratio + root);
  const int32_t rest = (int32_t)sqrt_u64(square - (uint64_t)((int64_t)weaken * weaken));
  return (complex_t){(ratio_i_q25 > 0) ? -weaken : weaken, (amplitude_i_q25 > 0) ? rest : -rest};
}

SMALL_CODE_END
