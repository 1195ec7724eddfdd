// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Program of its own: digests of what the control algorithms give for random inputs, the same source for the soft core
// and for the host. Equal digests: the core computes bit for bit what the tests on the host judge.
//
// A section is a group of algorithms; each draws its inputs from a generator of its own (xorshift, period 2^32 - 1) and
// puts every result into an FNV-1a hash of 32 bits. On the core the digests are sent as lines of eight hexadecimal digits.
#include "images/bench/control_digest.h"

#include "control/advance.h"
#include "control/boundary.h"
#include "control/carrier.h"
#include "control/complex_regulator.h"
#include "control/cross_coupling.h"
#include "control/csc_linearity.h"
#include "control/emf_observer.h"
#include "control/field_weakening.h"
#include "control/injection_error.h"
#include "control/injection_validity.h"
#include "control/limiter.h"
#include "control/line_current.h"
#include "control/mtpa.h"
#include "control/pi.h"
#include "control/pll.h"
#include "control/ramp.h"
#include "control/regulator_design.h"
#include "control/trig.h"
#include "control/vector_model.h"
#include "control/vector_speed.h"

#define SECTIONS 7u
#define FNV_OFFSET 2166136261u
#define FNV_PRIME 16777619u

typedef struct {
  uint32_t random;
  uint32_t hash;
} digest_t;

static uint32_t draw(digest_t *d) {
  d->random ^= d->random << 13;
  d->random ^= d->random >> 17;
  d->random ^= d->random << 5;
  return d->random;
}

// Signed, bits + 1 with the sign; smaller ones as often as large ones.
static int32_t draw_signed(digest_t *d, uint32_t bits) {
  const int32_t value = (int32_t)(draw(d) & ((1u << bits) - 1u)) - (int32_t)(1u << (bits - 1u));
  return value >> (draw(d) % bits);
}

static int32_t draw_within(digest_t *d, uint32_t most) { return (int32_t)(draw(d) % (most + 1u)); }

static complex_t draw_complex(digest_t *d, uint32_t bits) {
  const int32_t re = draw_signed(d, bits);
  return (complex_t){re, draw_signed(d, bits)};
}

static gain_t draw_gain(digest_t *d, int32_t shift) {
  return (gain_t){(1 << 30) + draw_within(d, (1u << 30) - 1u), shift};
}

static void put(digest_t *d, uint32_t value) {
  for (uint32_t i = 0; i < 4u; i++) {
    d->hash = (d->hash ^ ((value >> (8u * i)) & 0xFFu)) * FNV_PRIME;
  }
}

static void put_signed(digest_t *d, int32_t value) { put(d, (uint32_t)value); }

static void put_complex(digest_t *d, complex_t z) {
  put_signed(d, z.re);
  put_signed(d, z.im);
}

static void arithmetic(digest_t *d) {
  const gain_t g = draw_gain(d, 8 + draw_within(d, 40u));
  put_signed(d, gain_apply(draw_signed(d, 31), g));
  const int32_t x = draw_signed(d, 31);
  put_signed(d, mul_q16(x, draw_signed(d, 20)));
  const uint64_t n = (uint64_t)draw(d) << (draw(d) % 32u);
  const uint32_t divisor = (draw(d) >> (draw(d) % 31u)) | 1u;
  put(d, div_sat_u32(n, divisor));
  const uint64_t quotient = div_u64(n, divisor);
  put(d, (uint32_t)quotient);
  put(d, (uint32_t)(quotient >> 32));
  put(d, sqrt_u32(draw(d)));
  put(d, sqrt_u64(n));
  const complex_t a = draw_complex(d, 31);
  put_complex(d, complex_mul_q30(a, draw_complex(d, 30)));
  put_complex(d, complex_scale_q30(a, draw_signed(d, 31)));
  const complex_gain_t inverse = complex_inverse(a);
  put_complex(d, (complex_t){inverse.re, inverse.im});
  put_signed(d, inverse.shift);
}

static void angles(digest_t *d) {
  put_complex(d, cis_q30(draw(d)));
  const complex_t z = draw_complex(d, 31);
  put(d, complex_angle_turn_q32(z));
  put(d, complex_abs(z));
  const decay_t decay = decay_q30(draw(d) >> 1);
  put_signed(d, decay.factor_q30);
  put_signed(d, decay.slope_q30);
}

static vector_machine_t draw_machine(digest_t *d) {
  return (vector_machine_t){
      .resistance_q30 = draw(d) >> 4,
      .delay_q30 = (uint32_t)draw_within(d, 1u << 30),
      .admittance = draw_gain(d, 30),
      .impedance = draw_gain(d, 28),
      .period_cycles = 500u + draw(d) % 5000u,
      .harmonic = 1u + 2u * (draw(d) & 1u),
      .park = (draw(d) & 1u) ? PARK_HELD : PARK_EXACT,
  };
}

// Model, design of regulator and observer, then some samples of both and of the loop behind the observer.
static void vector(digest_t *d) {
  const vector_machine_t machine = draw_machine(d);
  const int32_t speed_turn_q36 = draw_signed(d, 22);
  vector_plant_t plant;
  vector_model_t model;
  vector_plant(&plant, &machine);
  vector_model(&model, &plant, speed_turn_q36);
  put_complex(d, model.phi_q30);
  put_complex(d, model.gamma1_q30);
  put_complex(d, model.gamma2_q30);
  put_complex(d, model.gamma_e_q30);
  put_signed(d, vector_lead_turn_q32(&machine, speed_turn_q36));
  const regulator_design_t wanted = {
      .order = (regulator_order_t)(draw(d) % 3u),
      .bandwidth_q30 = 1 + draw_within(d, 1u << 28),
      .gamma_q30 = (1 << 28) + draw_within(d, 1u << 28),
  };
  regulator_gains_t gains = {{1 << 16, 0}, {1 << 15, 0}, {1 << 16, 0}, 10};
  put(d, regulator_design(&gains, &wanted, &machine, &model));
  put_complex(d, gains.g);
  put_complex(d, gains.h);
  put_complex(d, gains.ratio_q17);
  put_signed(d, gains.shift);
  emf_observer_gains_t observing;
  emf_observer_design(&observing, &machine, &model, 3 << 28, 3 << 28);
  emf_observer_t observer;
  emf_observer_preset(&observer, draw_complex(d, 17), draw_complex(d, 24), draw_complex(d, 24));
  complex_regulator_t regulator;
  complex_regulator_preset(&regulator, draw_complex(d, 24), draw_complex(d, 17));
  pll_t pll;
  pll_preset(&pll, draw(d), speed_turn_q36);
  const pll_gains_t loop = {draw_gain(d, 32), draw_gain(d, 24), draw_gain(d, 28), 1 << 26};
  for (uint32_t k = 0; k < 8u; k++) {
    const complex_t current = draw_complex(d, 17);
    emf_observer_step(&observer, &observing, current, draw_signed(d, 28));
    put(d, complex_regulator_step(&regulator, &gains, draw_complex(d, 17), current, draw_within(d, 1u << 17)));
    put_complex(d, regulator.voltage_v_q25);
    emf_observer_voltage(&observer, &observing, draw_complex(d, 25));
    emf_observer_turn_small(&observer, draw_signed(d, 27));
    put_complex(d, observer.current_i_q25);
    put_complex(d, observer.emf_v_q25);
    const int32_t error = pll_error_q30(observer.emf_v_q25, speed_turn_q36, 1u << 10);
    put_signed(d, error);
    put_signed(d, pll_step(&pll, &loop, machine.period_cycles, error));
    put(d, pll_angle_turn_q32(&pll));
    put_signed(d, pll_speed_turn_q36(&pll));
  }
}

static void speed(digest_t *d) {
  const pi_gains_t gains = {draw_gain(d, 28), draw_gain(d, 34)};
  pi_state_t state = {0};
  vector_speed_preset(&state, &gains, draw_signed(d, 22), draw_signed(d, 22), draw_signed(d, 24));
  field_weakening_t weakening = {0};
  const field_weakening_settings_t field = {draw_gain(d, 32), 1 << 24, -(1 << 24)};
  ramp_t ramp;
  ramp_preset(&ramp, draw_signed(d, 24));
  for (uint32_t k = 0; k < 8u; k++) {
    const int32_t rest = current_rest_i_q25(draw_within(d, 1u << 25), draw_signed(d, 25));
    const pi_result_t result =
        vector_speed_step(&state, &gains, draw_signed(d, 22), draw_signed(d, 22), draw_signed(d, 20), rest);
    put_signed(d, result.output);
    put_signed(d, result.unlimited);
    const pi_result_t between =
        vector_speed_between(&state, &gains, draw_signed(d, 22), draw_signed(d, 20), -rest / 2, rest);
    put_signed(d, between.output);
    put_signed(d, between.unlimited);
    put_signed(d, field_weakening_step(&weakening, &field, draw_complex(d, 26), 0));
    put_complex(d, mtpa_current_i_q25(draw_signed(d, 25), 1 + draw_within(d, 1u << 25)));
    put_signed(d, ramp_step(&ramp, draw_signed(d, 26), 1 + draw_within(d, 1u << 24), draw_signed(d, 26), 1 << 18));
    put_signed(d, ramp.value_rpm_q8);
  }
}

static void six_step(digest_t *d) {
  const uint32_t period = 200u + draw(d) % 5000u;
  const csc_linearity_t linearity = csc_linearity(draw(d) >> (8u + draw(d) % 12u), period, 600);
  put(d, linearity.first_q16);
  put(d, linearity.second_q16);
  put_signed(d, csc_linear_duty_q30(&linearity, draw_within(d, 1u << 30)));
  const int32_t link = draw_within(d, 1u << 25);
  const int32_t duty = duty_from_voltage_q30(draw_signed(d, 26), link, draw_within(d, 1u << 20));
  put_signed(d, duty);
  put_signed(d, voltage_from_duty_v_q25(duty, link, 1 << 18));
  put(d, carrier_period_cycles(duty, period, period + 3000u, draw(d) % 400u));
  put(d, pulse_cycles_q8(duty, period, draw_signed(d, 13)));
  const int32_t ratio = line_current_ratio_q16(link, draw_signed(d, 25), draw_signed(d, 22), 1 << 18, duty);
  put_signed(d, ratio);
  put_signed(d, line_current(draw_signed(d, 18), ratio));
  put_signed(d, advance_added_q16(draw_signed(d, 15), draw_within(d, 1u << 17), draw_signed(d, 15), 1 << 15));
  const boundary_t edge =
      boundary(draw_within(d, 1u << 24), link, draw_within(d, 1u << 20), 500u + draw(d) % 50000u, draw_gain(d, 30));
  put_signed(d, edge.duty_q30);
  put_signed(d, edge.current_i_q25);
  put_signed(d, boundary_share_q16(&edge, draw_signed(d, 25)));
  put_signed(d, discontinuous_duty_q30(&edge, draw_within(d, 65536u)));
  limiter_t limiter = {draw_signed(d, 20)};
  const limiter_gains_t gains = {draw_gain(d, 24), draw_gain(d, 28)};
  const int32_t resistive = draw_within(d, 1u << 22), margin = draw_signed(d, 17);
  put_signed(d, limiter_bound(&limiter, &gains, draw_signed(d, 24), resistive, margin));
  limiter_update(&limiter, &gains, resistive, margin, draw(d) & 1u);
  put_signed(d, limiter.trim_v_q25);
}

static void injection(digest_t *d) {
  const injection_error_settings_t settings = {
      .method = (injection_method_t)(draw(d) % 4u),
      .ratio = draw_gain(d, 29),
      .loss = draw_gain(d, 34),
      .expected = draw_gain(d, 20),
      .shift = draw_within(d, 7),
      .minimum_i_q17 = 8,
  };
  const injection_amplitude_t amplitude = {draw_complex(d, 20), draw_complex(d, 20), 1u + draw(d) % 16u};
  put(d, injection_magnitude_i_q17(&settings, &amplitude));
  put_complex(d, injection_vector_i_q21(&settings, &amplitude));
  put_signed(d, injection_error_q30(&settings, &amplitude));
}

static void coupling(digest_t *d) {
  const cross_coupling_settings_t settings = {
      .c_q32 = {draw_signed(d, 28), draw_signed(d, 28), draw_signed(d, 27), draw_signed(d, 27)},
      .current = draw_gain(d, 26),
      .filter_q16 = draw_within(d, 1u << 16),
      .following = true,
  };
  cross_coupling_t curve;
  cross_coupling_begin(&curve, &settings, draw_signed(d, 24));
  const injection_validity_settings_t limits = {
      .minimum_i_q21 = 1 << 10,
      .expected_i_q21 = 1 << 16,
      .saliency_q16 = 3u << 15,
      .derate_ratio_q16 = 80000u,
      .fault_ratio_q16 = 70000u,
      .noise_factor_q16 = 1u << 16,
      .derate_noise_q16 = 3000u,
      .fault_noise_q16 = 6000u,
      .filter_shift = 3,
      .fault_results = 6u,
  };
  injection_validity_t validity;
  injection_validity_begin(&validity);
  for (uint32_t k = 0; k < 32u; k++) {
    put_signed(d, cross_coupling_step(&curve, &settings, draw_signed(d, 24)));
    injection_validity_step(&validity, &limits, (complex_t){(1 << 16) + draw_signed(d, 14), draw_signed(d, 14)});
    put(d, validity.noise_q16);
    put(d, validity.ratio_q16);
    put(d, validity.share_q16);
    put(d, (uint32_t)validity.verdict);
  }
}

uint32_t control_digest(uint32_t section, uint32_t seed, uint32_t rounds) {
  static void (*const round[SECTIONS])(digest_t *) = {arithmetic, angles, vector, speed, six_step, injection, coupling};
  digest_t digest = {seed, FNV_OFFSET};
  for (uint32_t i = 0; i < rounds; i++) {
    round[section](&digest);
  }
  return digest.hash;
}

#ifndef FL_HOST
#include "hal/chip.h"
#include "hal/cpu.h"
#include "hal/soc/trap.h"
#include "hal/uart.h"

#define UART_BIT_CYCLES 50u

typedef struct {
  uint32_t seed;
  uint32_t rounds[SECTIONS];
} table_t;

// Nothing interrupts: no source is enabled.
void trap_current(void) {}
void trap_control(void) {}
void trap_deferred(void) {}

int main(void) {
  const table_t *table = (const table_t *)RAM_TABLE;
  chip_gates_off();
  chip_irq_configure(0, 0);
  uart_configure(UART_BIT_CYCLES);
  for (uint32_t section = 0; section < SECTIONS; section++) {
    const uint32_t value = control_digest(section, table->seed, table->rounds[section]);
    for (uint32_t digit = 8; digit-- > 0u;) {
      uart_put((uint8_t)"0123456789abcdef"[(value >> (4u * digit)) & 15u]);
    }
    uart_put('\n');
  }
  for (;;) {
  }
}
#endif
