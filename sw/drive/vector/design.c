// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "control/fixed.h"
#include "control/placement.h"
#include "control/trig.h"
#include "drive/vector/current.h"
#include "drive/vector/injected.h"
#include "drive/vector/parts.h"

// A speed of 2^-36 turn a clock in 2^-32 rad: 2 pi / 16.
#define TURN_RAD_Q9 201
#define DRIFT_MOST_RAD_Q32 (1 << 28)
#define FOUR_OVER_PI_Q8 326u
// The time in which the estimate is lost, 5 ms.
#define LOST_PER_SECOND 200u
// Clocks from a pin of the encoder to its position, besides the filter.
#define ENCODER_LATENCY 3u

// A gain a tick as one a round of the groups.
static gain_t per_round(gain_t g) {
  if (g.shift >= 6) {
    g.shift -= 2;
  }
  return g;
}

// The modulator adds what the dead time takes by the currents of the sample. They have turned on when it acts, by phi =
// omega (T_d + T_s/2): with it as a vector c what acts in truth is more than the voltage by
//
//   c (exp(-j phi) - 1)   inverse Park exact,   c (1 - exp(j phi))   held
//
// which lies across the EMF: c (T_d + T_s/2) / psi at any speed. c along the current I: the fundamental of what grows
// from the band B over the zone Z (describing function),
//
//   slope I (F((B + Z)/I) - F(B/I)),   F(x) = 2/pi (asin x + x sqrt(1 - x^2)), x < 1; 1 beyond
//
// F as 4/pi x - (4/pi - 1) x^3: to 1 % of the largest.
DESIGN static uint32_t reached_q16(uint32_t current_i_q17, uint32_t size_i_q17) {
  if (current_i_q17 >= size_i_q17) {
    return 1u << 16;
  }
  const uint32_t x_q14 = (current_i_q17 << 14) / size_i_q17;
  const uint32_t cube_q14 = (((x_q14 * x_q14) >> 14) * x_q14) >> 14;
  return (x_q14 * FOUR_OVER_PI_Q8 - cube_q14 * (FOUR_OVER_PI_Q8 - 256u)) >> 6;
}

DESIGN static complex_t late_compensation_v_q25(const vector_t *v) {
  const parameters_t *p = v->p;
  const uint32_t size = complex_abs(v->reference_i_q25);
  const uint32_t size_i_q17 = size >> 8;
  if (size_i_q17 <= v->band_i_q17) {
    return (complex_t){0, 0};
  }
  const uint32_t grown_q16 =
      reached_q16(v->band_i_q17 + v->zone_i_q17, size_i_q17) - reached_q16(v->band_i_q17, size_i_q17);
  const uint64_t linear_q8 = ((uint64_t)size * (uint32_t)p->vector_slope) >> p->vector_slope_shift;
  const uint32_t cycles_q8 = (uint32_t)((linear_q8 * grown_q16) >> 16);
  const uint32_t carrier_q8 = (uint32_t)p->vector_sample_cycles << ((p->vector_double != 0) ? 9 : 8);
  const uint32_t added_v_q25 = div_sat_u32((uint64_t)(uint32_t)v->report.vdc_v_q25 * cycles_q8, carrier_q8);
  const uint32_t share_q30 = div_sat_u32((uint64_t)added_v_q25 << 30, size);
  const complex_t added = complex_scale_q30(v->reference_i_q25, sat_i32((int64_t)share_q30));
  const bool held = v->plant.machine.park == PARK_HELD;
  const uint32_t turn = (uint32_t)vector_action_turn_q32(&v->plant.machine, v->report.vector.speed_turn_q36);
  const complex_t turned = complex_mul_q30(added, cis_q30(held ? turn : 0u - turn));
  return held ? complex_sub(added, turned) : complex_sub(turned, added);
}

SMALL_CODE_BEGIN
COLD vector_machine_t vector_machine(const parameters_t *p) {
  return (vector_machine_t){
      .resistance_q30 = (uint32_t)p->vector_resistance_q30,
      .delay_q30 = (uint32_t)p->vector_delay_q30,
      .admittance = p->vector_admittance,
      .impedance = p->vector_impedance,
      .period_cycles = (uint32_t)p->vector_sample_cycles,
      .harmonic = 1,
      .park = (p->vector_park != 0) ? PARK_EXACT : PARK_HELD,
  };
}

// Subspace 3, and subspace 1 as its regulators are to know it: with the separator they run at every second sample while
// there is a wave.
DESIGN static vector_machine_t injected_machine(vector_injection_t *j, const parameters_t *p, vector_machine_t machine) {
  vector_machine_t third = machine;
  third.resistance_q30 = (uint32_t)p->injection_third_resistance_q30;
  third.admittance = p->injection_third_admittance;
  third.impedance = p->injection_third_impedance;
  third.harmonic = 3;
  vector_plant(&j->third, &third);
  if (j->settings.error.method == INJECTION_SEPARATOR) {
    vector_plant(&j->single, &machine);
    vector_machine_join(&machine, 2);
    machine.resistance_q30 *= 2u;
  }
  return machine;
}

COLD void vector_constants(vector_t *v) {
  const parameters_t *p = v->p;
  const uint32_t samples = (uint32_t)p->vector_tick_samples;
  vector_machine_t machine = vector_machine(p);
  vector_machine_t observed = machine;
  observed.resistance_q30 = (uint32_t)p->vector_observer_resistance_q30;
  observed.admittance = p->vector_observer_admittance;
  observed.impedance = p->vector_observer_impedance;
  if (vector_injects(v)) {
    machine = injected_machine(v->injection, p, machine);
  }
  vector_plant(&v->plant, &machine);
  vector_plant(&v->observed, &observed);
  v->salient = p->vector_mtpa_ratio_i_q25 != 0 || p->injection != 0;
  v->stages = (p->injection != 0 && SUBSPACES > 1) ? VECTOR_STAGES + 1u : VECTOR_STAGES;
  v->per_tick = observed;
  vector_machine_join(&v->per_tick, samples);
  v->drift_rad_q32 = (p->tick_cycles * TURN_RAD_Q9 + 256) >> 9;
  v->drift_rad_q32 += mul_q16(v->drift_rad_q32, p->vector_cross_q16);
  v->drift_most_turn_q36 = DRIFT_MOST_RAD_Q32 / v->drift_rad_q32;
  if (p->vector_slope > 0) {
    const uint32_t zone = div_sat_u32((uint64_t)(uint32_t)p->vector_dead_comp_cycles << p->vector_slope_shift,
                                      (uint32_t)p->vector_slope);
    v->zone_i_q17 = (zone < SAMPLE_MAX_Q17) ? zone : SAMPLE_MAX_Q17;
  }
  v->start_settings = p->vector_start;
  v->speed_gains = (pi_gains_t){p->vector_speed.kp, per_round(p->vector_speed.ki)};
  v->weakening_ki = per_round(p->vector_weakening_ki);
  // numerator * 2^-36, the numerator to 30 bits.
  uint64_t numerator = v->speed_numerator_q8;
  v->to_rpm.shift = 36;
  while (numerator > (uint64_t)INT32_MAX) {
    numerator >>= 1;
    v->to_rpm.shift--;
  }
  v->to_rpm.mant = (int32_t)numerator;
  v->back_rpm_q8 = rpm_q8(v, p->vector_back_turn_q36);
  v->handover_rpm_q8 = rpm_q8(v, p->vector_handover_turn_q36);
  const int32_t stop_rpm_q8 = p->stop_rpm * 256;
  v->least_rpm_q8 = (stop_rpm_q8 > v->handover_rpm_q8) ? stop_rpm_q8 : v->handover_rpm_q8;
  v->lost_checks = (uint32_t)p->clock_hz / (LOST_PER_SECOND * VECTOR_GROUPS * (uint32_t)p->tick_cycles) + 1u;
  v->lost = (lost_angle_settings_t){
      .resistance = p->vector_lost_resistance,
      .floor_v_q25 = (uint32_t)p->vector_lost_floor_v_q25,
      .current_i_q25 = (uint32_t)p->rated_i_q17 * 256u / 10u,
      .least_turn_q36 = p->vector_back_turn_q36 / 2,
      .most = 4u * (v->lost_checks - 1u),
  };
  v->sensored = p->vector_angle != 0;
  v->encoder = p->encoder_quarters > 1;
  v->several = p->vector_tick_samples > 1;
  v->on_core = p->vector_direct != 0;
  v->shaped = p->vector_shape.most_turn_q36 != 0;
  v->forwards = v->shaped || vector_injects(v);
  v->encoder_settings =
      (encoder_settings_t){p->encoder_turn, (uint32_t)p->encoder_filter_cycles + ENCODER_LATENCY};
}
SMALL_CODE_END

// The regulator's zero cancels the machine's pole, whose disturbances then decay with R/L alone. In the frame that follows
// the EMF it stands where a larger resistance would put that pole: what a voltage not known leaves in the current is gone
// before the frame has turned with it. The forced frame needs the soft current: it damps the rotor's swing.
DESIGN static void design_regulator(vector_t *v, regulator_gains_t *gains) {
  const complex_t phi_q30 = v->model.phi_q30;
  if (v->frame == FRAME_OBSERVED) {
    v->model.phi_q30 = complex_scale_q30(phi_q30, v->p->vector_damping_q30);
  }
  v->fits = regulator_design(gains, &v->p->vector_regulator, &v->regulated->machine, &v->model);
  v->model.phi_q30 = phi_q30;
}

// The observer's model of a salient machine: the current turns back by (L_q - L) / L times the frame's turn besides, and
// what a voltage makes of it in a sample by half of that.
DESIGN static void cross_axes(vector_t *v) {
  vector_model_t *model = &v->model;
  const int32_t turn_q32 = vector_turn_q32(&v->observed.machine, v->design[1u - v->used].speed_turn_q36);
  const uint32_t back_q32 = 0u - (uint32_t)mul_q16(turn_q32, v->p->vector_cross_q16);
  const complex_t half = cis_q30((uint32_t)((int32_t)back_q32 / 2));
  model->phi_q30 = complex_mul_q30(model->phi_q30, cis_q30(back_q32));
  model->gamma1_q30 = complex_mul_q30(model->gamma1_q30, half);
  model->gamma2_q30 = complex_mul_q30(model->gamma2_q30, half);
  model->gamma_e_q30 = complex_mul_q30(model->gamma_e_q30, half);
}

COLD void vector_start_current(vector_t *v) {
  const int32_t most_i_q25 = v->settings->current_limit_q17 * 192;
  int32_t current_i_q25 = v->p->vector_start.current_i_q25;
  for (uint32_t k = 0; k < v->order->failed_starts && current_i_q25 < most_i_q25; k++) {
    current_i_q25 += current_i_q25 / 5 * 2;
    current_i_q25 = (current_i_q25 < most_i_q25) ? current_i_q25 : most_i_q25;
  }
  v->start_settings.current_i_q25 = current_i_q25;
}

const vector_plant_t *vector_present_plant(const vector_t *v) {
  const vector_injection_t *j = v->injection;
  const bool every = vector_injects(v) && j->settings.error.method == INJECTION_SEPARATOR && !j->wanted;
  return every ? &j->single : &v->plant;
}

void vector_design(vector_t *v) {
  const parameters_t *p = v->p;
  if (v->finished) {
    return;
  }
  vector_design_t *spare = &v->design[1u - v->used];
  const uint32_t stage = v->stage % v->stages;
  if (v->stage == v->stages * VECTOR_DESIGNS) {
    v->late_v_q25 = late_compensation_v_q25(v);
  } else if (stage == 0u) {
    // A step in between may have changed one part of a vector.
    const int32_t voltage_v_q25 = (int32_t)complex_abs(v->state_v_q25);
    v->band_i_q17 = (uint32_t)clamp_i32(gain_apply(voltage_v_q25, p->vector_band), 0, SAMPLE_MAX_Q17);
    if (v->frame != FRAME_OFF) {
      v->report.voltage_v_q25 = voltage_v_q25;
      v->report.motor_q17 = (int32_t)complex_abs(v->report.vector.current_i_q17);
    }
    v->regulated = vector_present_plant(v);
    spare->speed_turn_q36 = v->report.vector.speed_turn_q36;
    vector_model(&v->model, v->regulated, spare->speed_turn_q36);
  } else if (stage == 1u) {
    design_regulator(v, &spare->regulator);
    if (v->salient) {
      vector_model(&v->model, &v->observed, spare->speed_turn_q36);
    }
  } else if (stage == 2u) {
    if (p->vector_cross_q16 != 0) {
      cross_axes(v);
    }
    vector_model_join(&v->model, (uint32_t)p->vector_tick_samples);
    emf_observer_design(&spare->observer, &v->per_tick, &v->model, p->vector_pole1_q30, p->vector_pole2_q30);
  } else if (vector_injects(v)) {
    vector_model(&v->model, &v->injection->third, v->report.vector.speed_turn_q36);
    v->fits = regulator_design(&v->injection->third_gains, &p->vector_regulator, &v->injection->third.machine,
                               &v->model) &&
              v->fits;
  }
  __atomic_signal_fence(__ATOMIC_RELEASE);
  v->finished = v->fits && stage == v->stages - 1u;
  v->stage = (v->stage + 1u) % (v->stages * VECTOR_DESIGNS + 1u);
}

COLD void vector_take_design(vector_t *v) {
  vector_command_t *command = &v->command;
  v->used = 1u - v->used;
  current_gains(command, 0, &v->design[v->used].regulator);
  if (vector_injects(v)) {
    current_gains(command, 1, &v->injection->third_gains);
  }
  current_band(command, v->band_i_q17);
  v->finished = false;
}

void vector_design_off(vector_t *v) {
  const complex_t none = {0, 0};
  v->state_v_q25 = none;
  v->late_v_q25 = none;
  v->report.voltage_v_q25 = 0;
  v->report.motor_q17 = 0;
}

void vector_design_turn(vector_t *v, complex_t rotation_q30) {
  v->late_v_q25 = complex_mul_q30(v->late_v_q25, rotation_q30);
}

HOT void vector_design_state(vector_t *v, complex_t voltage_v_q25) { v->state_v_q25 = voltage_v_q25; }

HOT bool vector_design_meant(vector_t *v) {
  const bool meant = v->regulated == vector_present_plant(v);
  v->finished = v->finished && meant;
  return v->finished;
}

COLD void vector_first_design(vector_t *v) {
  for (uint32_t k = 0; k < v->stages; k++) {
    vector_design(v);
  }
  v->design[0] = v->design[1];
}
