// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Unit tests of sw/control: PI regulator, ramp, phase-locked loop, EMF observer. A program of its own for the soft core,
// a library for the host. Both write the same report: a line per failed check, a line per test, and their number.
#include "images/bench/unit.h"

#include "control/emf_observer.h"
#include "control/pi.h"
#include "control/pll.h"
#include "control/ramp.h"
#include "images/bench/unit_control.h"

#define ONE ((gain_t){1 << 30, 30})
#define ERROR 4096
#define LIMIT 100000

uint32_t unit_failures;

static void pi_enters_without_a_bump(void) {
  pi_state_t state;
  const pi_gains_t gains = {ONE, {1 << 30, 34}};
  pi_preset(&state, gains.kp, ERROR, 500, 70000);
  CHECK(pi_step(&state, &gains, ERROR, 500, -LIMIT, LIMIT).output, 70000);
}

static void pi_adds_ki_times_the_error(void) {
  pi_state_t state = {0};
  const pi_gains_t gains = {ONE, {1 << 30, 30}};
  pi_step(&state, &gains, ERROR, 0, -LIMIT, LIMIT);
  CHECK(state.integral_q5, ERROR);
  CHECK(pi_step(&state, &gains, ERROR, 0, -LIMIT, LIMIT).output, ERROR + (ERROR >> PI_INTEGRAL_BITS));
}

// Where ki e + (output - u) / 8 = 0: the integral stands, and u is beyond the limit by 8 ki e.
static void pi_winds_up_no_further_than_its_limit_lets_it(void) {
  pi_state_t state = {0};
  const pi_gains_t gains = {ONE, {1 << 30, 30}};
  pi_result_t result = {0};
  for (uint32_t i = 0; i < 2000u; i++) {
    result = pi_step(&state, &gains, ERROR, 0, -LIMIT, LIMIT);
  }
  CHECK(result.output, LIMIT);
  CHECK_NEAR(result.unlimited, LIMIT + 8 * (ERROR >> PI_INTEGRAL_BITS), 8);
}

static void ramp_arrives_and_stays(void) {
  ramp_t ramp;
  ramp_preset(&ramp, 0);
  for (uint32_t i = 0; i < 10u; i++) {
    CHECK(ramp_step(&ramp, 1000 << 8, 100 << 20, ramp.value_rpm_q8, 5000 << 8), 1);
  }
  CHECK(ramp.value_rpm_q8, 1000 << 8);
  CHECK(ramp_step(&ramp, 1000 << 8, 100 << 20, ramp.value_rpm_q8, 5000 << 8), 0);
}

static void ramp_waits_for_the_machine(void) {
  ramp_t ramp;
  ramp_preset(&ramp, 0);
  for (uint32_t i = 0; i < 100u; i++) {
    ramp_step(&ramp, 1000 << 8, 100 << 20, 0, 250 << 8);
  }
  CHECK(ramp.value_rpm_q8, 250 << 8);
}

// omega T_s a sample, modulo a turn: 2^36 / 100 a clock and 2500 clocks are 25 turns, but for what the division cut off.
static void pll_turns_with_its_speed(void) {
  pll_t pll;
  const pll_gains_t gains = {.angle = ONE, .speed = ONE, .speed_max_turn_q36 = 1 << 30};
  const int32_t speed_turn_q36 = 687194767;
  pll_preset(&pll, 12345u << 8, speed_turn_q36);
  pll_step(&pll, &gains, 2500, 0);
  const uint64_t turned = ((uint64_t)speed_turn_q36 * 2500u) >> 4;
  CHECK((int32_t)pll_angle_turn_q32(&pll), (int32_t)((12345u << 8) + (uint32_t)turned));
  CHECK(pll_speed_turn_q36(&pll), speed_turn_q36);
}

// At rest and without current the voltage is the EMF: e^ comes to u.
static void observer_finds_the_emf(void) {
  const vector_machine_t machine = {.resistance_q30 = 1 << 25, .admittance = ONE, .impedance = ONE,
                                    .period_cycles = 2500, .harmonic = 1, .park = PARK_HELD};
  vector_plant_t plant;
  vector_model_t model;
  emf_observer_gains_t gains;
  vector_plant(&plant, &machine);
  vector_model(&model, &plant, 0);
  emf_observer_design(&gains, &machine, &model, 3 << 28, 3 << 28);
  const complex_t voltage_v_q25 = {1 << 22, -(1 << 21)};
  emf_observer_t observer;
  emf_observer_preset(&observer, (complex_t){0, 0}, (complex_t){0, 0}, voltage_v_q25);
  for (uint32_t i = 0; i < 200u; i++) {
    emf_observer_step(&observer, &gains, (complex_t){0, 0}, 0);
    emf_observer_voltage(&observer, &gains, voltage_v_q25);
  }
  CHECK_NEAR(observer.emf_v_q25.re, voltage_v_q25.re, (1 << 22) / 1000);
  CHECK_NEAR(observer.emf_v_q25.im, voltage_v_q25.im, (1 << 22) / 1000);
}

static const unit_test_t tests[] = {
    {"pi_enters_without_a_bump", pi_enters_without_a_bump},
    {"pi_adds_ki_times_the_error", pi_adds_ki_times_the_error},
    {"pi_winds_up_no_further_than_its_limit_lets_it", pi_winds_up_no_further_than_its_limit_lets_it},
    {"ramp_arrives_and_stays", ramp_arrives_and_stays},
    {"ramp_waits_for_the_machine", ramp_waits_for_the_machine},
    {"pll_turns_with_its_speed", pll_turns_with_its_speed},
    {"observer_finds_the_emf", observer_finds_the_emf},
};

uint32_t unit_control(void) {
  const uint32_t count = sizeof tests / sizeof tests[0];
  uint32_t failed = 0;
  for (uint32_t n = 0; n < count; n++) {
    unit_failures = 0;
    tests[n].run();
    failed += (unit_failures != 0u) ? 1u : 0u;
    unit_text((unit_failures == 0u) ? "ok " : "FAILED "), unit_text(tests[n].name), unit_put('\n');
  }
  unit_number((int32_t)count), unit_text(" tests, "), unit_number((int32_t)failed), unit_text(" failed\n");
  return failed;
}

#if defined(FL_HOST)
static char report[4096];
static uint32_t written;

void unit_put(char letter) {
  if (written < sizeof report - 1u) {
    report[written++] = letter;
    report[written] = '\0';
  }
}

const char *unit_report(void) {
  written = 0;
  return report;
}
#else
#include "hal/chip.h"
#include "hal/soc/trap.h"
#include "hal/uart.h"

#define UART_BIT_CYCLES 50u

void unit_put(char letter) { uart_put((uint8_t)letter); }

// Nothing interrupts: no source is enabled.
void trap_current(void) {}
void trap_control(void) {}
void trap_deferred(void) {}

int main(void) {
  chip_gates_off();
  chip_irq_configure(0, 0);
  uart_configure(UART_BIT_CYCLES);
  unit_control();
  for (;;) {
  }
}
#endif
