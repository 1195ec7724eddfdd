// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0 WITH SHL-2.1

// Types of the injection blocks: settings, results, requests to the shared multiplier.
//
// Vectors are {q, d}: index 0 is d. Formats: the headers of fl_injection, fl_lock_in, fl_iq_demod, fl_separator.
package fl_injection_pkg;

  import fl_pkg::sample_t;

  localparam int unsigned PhaseBits = 12;
  localparam int unsigned FineShift = 5;

  typedef logic [PhaseBits-1:0] phase_t;  // updates since the rising edge of the square wave
  typedef logic signed [23:0] state_t;

  typedef enum logic [1:0] {
    MethodLockIn       = 2'd0,  // reference sign(I_dh)
    MethodConventional = 2'd1,  // reference sine
    MethodIq           = 2'd2,  // sums over whole injection periods
    MethodSeparator    = 2'd3   // four samples an injection period
  } method_e;

  // Trapezoidal state-variable filter: g = tan(pi f0 / fs), a1 = 1 / (1 + g (g + k)), a2 = g a1.
  typedef struct packed {
    logic    fine;  // g and a2 in 2^-22 instead of 2^-17
    sample_t a1;    // 2^17 = 1
    sample_t a2;
    sample_t g;
  } filter_t;

  // One product, with what becomes of it: sum = (first ? 2^half : accumulator) + x c (high ? 2^FineShift : 1).
  typedef struct packed {
    logic               enable;
    logic               accumulator;
    logic               first;
    logic               high;
    logic [4:0]         half;
    sample_t            x;
    logic signed [24:0] c;
  } mac_t;

  localparam int unsigned SumBits = 49;
  typedef logic signed [SumBits-1:0] sum_t;

  typedef struct packed {
    logic               enable;
    method_e            method;
    logic               remove;      // hf out of the current for the regulators
    phase_t             period;
    phase_t             first;
    phase_t             delay;
    logic [31:0]        rate;
    sample_t [1:0][1:0] amplitude;   // [subspace][axis]
    logic [31:0]        lag;         // of the sine reference, 2^32 = one turn
    logic               sine;        // I/Q: sine instead of square reference
    filter_t            band;
    sample_t            band_k;
    filter_t            low;
    logic [2:0]         shift;
  } settings_t;

  // Amplitudes of the HF current against the reference, formats by method.
  typedef struct packed {
    logic [1:0][31:0] im;  // signed
    logic [1:0][31:0] re;
  } result_t;

  // Square wave of even symmetry about its edges: +1 in the first half, -1 in the second, 0 in the middle one of an odd
  // number of updates.
  function automatic logic signed [1:0] square(phase_t phase, phase_t period);
    if (phase < period >> 1) return 2'sd1;
    else if (period[0] && phase == period >> 1) return 2'sd0;
    else return -2'sd1;
  endfunction

  // (a + b) modulo period, both below it.
  function automatic phase_t phase_sum(phase_t a, phase_t b, phase_t period);
    logic [PhaseBits:0] sum;
    sum = {1'b0, a} + {1'b0, b};
    return (sum >= {1'b0, period}) ? phase_t'(sum - {1'b0, period}) : phase_t'(sum);
  endfunction

  function automatic logic clips(sum_t x);
    return x[SumBits-1:23] != {(SumBits - 23) {x[SumBits-1]}};
  endfunction

  function automatic state_t sat_state(sum_t x);
    return clips(x) ? {x[SumBits-1], {23{!x[SumBits-1]}}} : x[23:0];
  endfunction

endpackage
