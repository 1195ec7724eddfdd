// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/injection_error.h"

#include <stdbool.h>

#include "control/placement.h"
#include "control/trig.h"

#define RATIO_BITS 28
#define LOCK_IN_BITS 4    // of its amplitudes below i_q17
#define SEPARATOR_BITS 1
// In units of 2^-21 of full scale: amplitude a sample of the I/Q sums, of the separator.
#define IQ_UNITS 8
#define SEPARATOR_UNITS 8

SMALL_CODE_BEGIN

HOT static int32_t unit_q30(int64_t error_q30) {
  return (int32_t)((error_q30 > ONE_Q30) ? ONE_Q30 : (error_q30 < -ONE_Q30) ? -ONE_Q30 : error_q30);
}

// part / (whole 2^more) in q28, within +-2; |whole| 2^more below 2^31.
HOT static int32_t real_ratio_q28(int32_t part, int32_t whole, int32_t more) {
  const uint32_t most = (uint32_t)1 << (RATIO_BITS + 1);
  const uint32_t divisor = (uint32_t)abs_sat(whole) << more;
  const uint32_t ratio = div_sat_u32((uint64_t)(uint32_t)abs_sat(part) << RATIO_BITS, divisor);
  const int32_t held = (int32_t)((ratio < most) ? ratio : most);
  return ((part < 0) != (whole < 0)) ? -held : held;
}

HOT uint32_t injection_magnitude_i_q17(const injection_error_settings_t *settings,
                                       const injection_amplitude_t *amplitude) {
  switch (settings->method) {
    case INJECTION_IQ:
      return (amplitude->count == 0u) ? 0u : complex_abs(amplitude->d) / amplitude->count / 2u;
    case INJECTION_SEPARATOR:
      return (uint32_t)abs_sat(amplitude->d.re) >> SEPARATOR_BITS;
    case INJECTION_LOCK_IN:
    case INJECTION_CONVENTIONAL:
    default:
      return (uint32_t)abs_sat(amplitude->d.re) >> LOCK_IN_BITS;
  }
}

// |d| and Re(q conj(d)) / |d|, a sample.
static complex_t iq_vector_i_q21(const injection_amplitude_t *amplitude) {
  const uint32_t length = complex_abs(amplitude->d);
  if (amplitude->count == 0u || length == 0u) {
    return (complex_t){0, 0};
  }
  const int64_t along = (int64_t)amplitude->q.re * amplitude->d.re + (int64_t)amplitude->q.im * amplitude->d.im;
  const uint64_t size = (along < 0) ? 0u - (uint64_t)along : (uint64_t)along;
  const int32_t q = sat_i32((int64_t)div_sat_u32(size, length));
  const int32_t d = sat_i32((int64_t)length);
  const int32_t count = (int32_t)amplitude->count;
  return (complex_t){d / count * IQ_UNITS, ((along < 0) ? -q : q) / count * IQ_UNITS};
}

complex_t injection_vector_i_q21(const injection_error_settings_t *settings, const injection_amplitude_t *amplitude) {
  const bool turned = amplitude->d.re < 0;
  const complex_t z = {abs_sat(amplitude->d.re), turned ? -amplitude->q.re : amplitude->q.re};
  switch (settings->method) {
    case INJECTION_IQ:
      return iq_vector_i_q21(amplitude);
    case INJECTION_SEPARATOR:
      return (complex_t){z.re * SEPARATOR_UNITS, z.im * SEPARATOR_UNITS};
    case INJECTION_LOCK_IN:
    case INJECTION_CONVENTIONAL:
    default:
      return (complex_t){z.re, z.im >> settings->shift};
  }
}

// Re(q/d) ratio + Im(q/d) loss. q is halved, so that the products keep their room.
HOT static int32_t iq_error_q30(const injection_error_settings_t *settings, const injection_amplitude_t *amplitude) {
  complex_gain_t inverse = complex_inverse(amplitude->d);
  inverse.shift -= RATIO_BITS + 1;
  const complex_t z_q28 = complex_gain_apply((complex_t){amplitude->q.re / 2, amplitude->q.im / 2}, inverse);
  const int64_t sum_q28 = (int64_t)gain_apply(within_i32(z_q28.re, ONE_Q30), settings->ratio) +
                          gain_apply(within_i32(z_q28.im, ONE_Q30), settings->loss);
  return unit_q30(sum_q28 * 4);
}

HOT int32_t injection_error_q30(const injection_error_settings_t *settings, const injection_amplitude_t *amplitude) {
  const uint32_t magnitude_i_q17 = injection_magnitude_i_q17(settings, amplitude);
  if (magnitude_i_q17 == 0u || magnitude_i_q17 < settings->minimum_i_q17) {
    return 0;
  }
  if (settings->method == INJECTION_IQ) {
    return iq_error_q30(settings, amplitude);
  }
  if (settings->method == INJECTION_SEPARATOR && settings->expected.mant != 0) {
    const int64_t error_q29 = gain_apply(amplitude->q.re, settings->expected);
    return unit_q30(error_q29 * 2);
  }
  const int32_t more = (settings->method == INJECTION_SEPARATOR) ? 0 : settings->shift;
  const int32_t ratio_q28 = real_ratio_q28(amplitude->q.re, amplitude->d.re, more);
  return unit_q30((int64_t)gain_apply(ratio_q28, settings->ratio) * 4);
}

SMALL_CODE_END
