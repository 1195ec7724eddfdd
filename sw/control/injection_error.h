// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Angle error of the injection from the amplitudes that the chip's demodulators find, L_q > L_d.
//
//   lock-in, conventional, separator   e = L_q / (L_q - L_d) I_q / I_d
//   I/Q                                e = L_q / (L_q - L_d) Re(I_q / I_d) + R / (w (L_q - L_d)) Im(I_q / I_d)
//   separator by its expected size     e = K I_q                              K = 4 L_d L_q / (T_h U_h (L_q - L_d))
//
// e is theta - theta_hat in radians for small errors, as pll.h takes it: e_q30, held within +-1. w: injection frequency.
// I_d normalises: voltage lost to the dead time, supply and saturation fall out. Below a size of I_d there is no angle
// and e is 0. Sources: Tian 2019, Yu 2022; docs/theory/five-phase.md.
//
// Units of the amplitudes: lock-in 2^21 = full scale, the error times 2^shift; I/Q 2^19 count; separator 2^18.
#ifndef FL_INJECTION_ERROR_H
#define FL_INJECTION_ERROR_H

#include <stdint.h>

#include "control/complex_fixed.h"
#include "control/fixed.h"

typedef enum { INJECTION_LOCK_IN, INJECTION_CONVENTIONAL, INJECTION_IQ, INJECTION_SEPARATOR } injection_method_t;

// As the chip latches them; im and count of I/Q only. Real ones below 2^23.
typedef struct {
  complex_t d;
  complex_t q;
  uint32_t count;
} injection_amplitude_t;

typedef struct {
  injection_method_t method;
  gain_t ratio;         // L_q / (L_q - L_d)
  gain_t loss;          // I/Q: R / (w (L_q - L_d))
  gain_t expected;      // separator: K, unit of the amplitude -> e_q29; mant 0: normalised by I_d
  int32_t shift;        // lock-in, conventional: 0..7
  uint32_t minimum_i_q17;  // of I_d
} injection_error_settings_t;

// Size of I_d: of the separator the peak, of I/Q the amplitude of the fundamental, of the lock-in the mean of
// h_d times the reference. 0 for I/Q without samples. About 430 clocks for I/Q, else 10.
uint32_t injection_magnitude_i_q17(const injection_error_settings_t *settings, const injection_amplitude_t *amplitude);

// The amplitudes along each other, 2^21 = full scale: re of I_d, positive, im of I_q with its sign against it, both
// real. Zero without samples. About 1000 clocks for I/Q, else 20.
complex_t injection_vector_i_q21(const injection_error_settings_t *settings, const injection_amplitude_t *amplitude);

// e. About 1100 clocks for I/Q, else 250.
int32_t injection_error_q30(const injection_error_settings_t *settings, const injection_amplitude_t *amplitude);

#endif
