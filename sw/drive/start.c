// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "drive/start.h"

#include "control/fixed.h"
#include "control/placement.h"
#include "control/speed.h"
#include "control/startup.h"
#include "drive/hall.h"
#include "drive/run.h"
#include "drive/vector.h"

#define COAST_CALM_TICKS 8u
// Currents and latched trips of before are gone.
#define CLEAR_SETTLE_TICKS 4u
#define ALIGN_LEG_FIRST 0u
#define ALIGN_LEG_SECOND 1u
// 1 ms at 10 kHz; the current is filtered.
#define ALIGN_PULLED_TICKS 10u
#define HALVINGS_MAX 4u
#define SQRT2_Q16 92682u
#define INTERVAL_MAX 0xFFFFFFu
#define LOCK_TIMEOUT_Q12 0xFFFFu

static void enter_phase(drive_t *drive, phase_t phase) {
  drive->phase = phase;
  drive->state_ticks = 0;
}

static void legs(drive_t *drive, leg_command_t others, uint32_t special, leg_command_t command) {
  for (uint32_t x = 0; x < PHASES; x++) {
    drive->command.leg[x] = (x == special) ? command : others;
  }
}

static void direct(drive_t *drive, bool reverse) {
  drive->reverse = reverse;
  drive->command.reverse = reverse;
  hall_begin(drive);
}

void start_begin(drive_t *drive) {
  drive_gates_off(drive);
  drive_enter(drive, STATE_STARTING);
  // The vector drive's speeds have a sign.
  direct(drive, drive->settings.target_rpm < 0 && method_is_six_step(drive->p->method));
  drive_take_crossing(drive);
  drive->calm_ticks = 0;
  catch_reset(&drive->rotor);
  stuck_reset(&drive->stuck);
  drive->pulled_ticks = 0;
  enter_phase(drive, START_COAST);
  // The edges are measured while the rotor coasts.
  drive->command.timer = drive->hall.driving ? COMMUTATION_HALL : COMMUTATION_OFF;
  drive->command.clear_trips = true;
}

void start_failed(drive_t *drive) {
  drive->failed_starts++;
  drive->pulled_out = false;
  if (drive->failed_starts > (uint32_t)drive->p->start_retries) {
    drive_enter_fault(drive, FAULT_START_FAILED);
    return;
  }
  hall_resort(drive);
  start_begin(drive);
}

// The forced field lags a lightly loaded rotor by up to 90 degrees, its crossings are late ones then and the next
// sectors short until the field has caught up. Intervals mean little meanwhile: nothing commutates blindly on them.
static void begin_lock(drive_t *drive) {
  const parameters_t *p = drive->p;
  drive->command.timer = COMMUTATION_ZCD;
  drive->command.miss_limit = (uint32_t)p->miss_limit;
  drive->command.force_on_miss = false;
  drive->command.timeout_q12 = LOCK_TIMEOUT_Q12;
  drive_apply_voltage(drive, p->lock_v_q25 + gain_apply(p->handover_rpm * 256, p->emf), true);
  drive->locked_from = drive->m.crossings;
  enter_phase(drive, START_LOCK);
}

#define CATCH_FAILURES_MAX 2u
#define CAUGHT_TICKS 2u
// 50 ms at 10 kHz: half a turn at 10 Hz, in which a terminal may stay at its rail.
#define STUCK_TICKS 500u

// Channels that show an EMF without a rotor are given up. What a load has turned is no such failure.
static bool may_catch(const drive_t *drive) {
  return drive->settings.catch && (drive->failed_starts < CATCH_FAILURES_MAX || drive->pulled_out);
}

// The amplitude of the EMF belongs to the speed at which its angle turns, to a quarter: all three channels measure.
static bool plausible(const drive_t *drive, int32_t line_emf_q17, int32_t speed_rpm_q8) {
  const int32_t emf_q17 = gain_apply(speed_rpm_q8, drive->p->emf) / 256;
  return abs_sat(line_emf_q17 - emf_q17) < emf_q17 / 4;
}

// A rotor that turns fast enough for its crossings is taken over at its speed, in whichever direction. True: done.
static bool caught(drive_t *drive, const int32_t v_q17[PHASES], int32_t line_emf_q17) {
  const parameters_t *p = drive->p;
  int32_t mean_step = 0;
  if (!may_catch(drive) || line_emf_q17 < p->catch_v_q17) {
    catch_reset(&drive->rotor);
    return false;
  }
  if (!catch_step(&drive->rotor, v_q17, &mean_step)) {
    return false;
  }
  const int32_t speed_rpm_q8 = gain_apply(abs_sat(mean_step) / 256, p->catch_speed);
  if (!plausible(drive, line_emf_q17, speed_rpm_q8) || speed_rpm_q8 / 256 > p->overspeed_rpm || drive->m.vdc_v_q25 == 0) {
    return false;
  }
  if (method_is_vector(p->method)) {
    return vector_catch(drive, drive->rotor.angle, mean_step);
  }
  // What is written now takes effect at the next tick.
  chip_command_t *command = &drive->command;
  drive->reverse = mean_step < 0;
  command->gate_enable = true;
  command->sequencer = SEQUENCER_SIX_STEP;
  command->start_sector = catch_sector(drive->rotor.angle + (uint32_t)mean_step, drive->reverse);
  command->reverse = drive->reverse;
  command->forced_interval_cycles = catch_sector_cycles(mean_step, (uint32_t)p->tick_cycles);
  command->zcd_enable = true;
  drive->catches++;
  begin_lock(drive);
  // The interval is known: a missed crossing is one.
  command->force_on_miss = true;
  command->timeout_q12 = (uint32_t)p->timeout_q12;
  // No current: the voltage is the EMF. The carrier follows from the sector's length, which is not measured yet.
  drive->m.longest_cycles = clamp_u32(command->forced_interval_cycles / 6u, drive->settings.carrier_period_cycles,
                                      drive->m.longest_cycles);
  drive_apply_voltage(drive, gain_apply(speed_rpm_q8, p->emf), drive->settings.sync_rect);
  return true;
}

// The same by the edges, which are being measured.
static bool caught_by_edges(drive_t *drive) {
  const parameters_t *p = drive->p;
  const measured_t *m = &drive->m;
  const int32_t emf_v_q25 = gain_apply(m->speed_rpm_q8, p->emf);
  // The edges need no EMF to be seen. A rotor that turns the wrong way was let go at the stop speed to slow down.
  const bool wrong = drive->hall.backward != (drive->settings.target_rpm < 0);
  const bool fast = wrong ? emf_v_q25 / 256 >= p->catch_v_q17 : m->speed_rpm_q8 >= p->handover_rpm * 256;
  const bool turning = m->speed_valid && !hall_rotor_slow(drive) && fast;
  if (!may_catch(drive) || !turning || m->speed_rpm_q8 / 256 > p->overspeed_rpm || m->vdc_v_q25 == 0) {
    drive->calm_ticks = 0;
    return false;
  }
  if (drive->hall.backward != drive->reverse) {
    direct(drive, drive->hall.backward);
    drive->calm_ticks = 0;
    return false;
  }
  // A direction that was set takes effect at the next tick.
  drive->calm_ticks++;
  if (drive->calm_ticks <= CAUGHT_TICKS) {
    return false;
  }
  drive->command.gate_enable = true;
  drive->command.sequencer = SEQUENCER_SIX_STEP;
  drive->command.zcd_enable = true;
  drive->catches++;
  drive->locked_from = m->crossings;
  drive_apply_voltage(drive, emf_v_q25, drive->settings.sync_rect);
  enter_phase(drive, START_LOCK);
  return true;
}

// Whether the rotor is slow enough to be shorted by the lower switches. The more often a start failed, the longer the
// calm: voltage channels may fail for a while and show no EMF.
static bool calm(drive_t *drive, int32_t line_emf_q17) {
  const uint32_t wanted = COAST_CALM_TICKS << clamp_u32(drive->failed_starts, 0, HALVINGS_MAX);
  if (drive->hall.driving) {
    return drive->state_ticks > wanted && hall_rotor_slow(drive);
  }
  drive->calm_ticks = (line_emf_q17 < drive->p->coast_v_q17) ? drive->calm_ticks + 1u : 0u;
  return drive->calm_ticks >= wanted;
}

// Gates off until the EMF of the rotor is small enough to be shorted by the lower switches.
static void coast(drive_t *drive, const chip_snapshot_t *in) {
  const parameters_t *p = drive->p;
  int32_t v_q17[PHASES];
  const int32_t line_emf_q17 = catch_restore(in->v_q17, p->diode_v_q25 / 256, v_q17);
  const bool settled = drive->state_ticks > CLEAR_SETTLE_TICKS;
  if (settled && (drive->hall.driving ? caught_by_edges(drive) : caught(drive, v_q17, line_emf_q17))) {
    return;
  }
  if (!drive->hall.driving && stuck_step(&drive->stuck, in->v_q17, line_emf_q17 >= p->catch_v_q17, STUCK_TICKS)) {
    drive_enter_fault(drive, FAULT_VOLTAGE_CHANNEL);
    return;
  }
  if (!calm(drive, line_emf_q17)) {
    if (drive->state_ticks > (uint32_t)p->coast_timeout_ticks) {
      drive_enter_fault(drive, FAULT_ROTOR_SPINNING);
    }
    return;
  }
  const int32_t vdc_q17 = drive->m.vdc_v_q25 / 256;
  if (vdc_q17 < p->vdc_min_q17) {
    drive_enter_fault(drive, FAULT_UNDER_VOLTAGE);
  } else if (vdc_q17 > p->vdc_max_q17) {
    drive_enter_fault(drive, FAULT_OVER_VOLTAGE);
  } else if (method_is_vector(p->method)) {
    vector_begin(drive);
  } else {
    drive->command.gate_enable = true;
    drive->command.sequencer = SEQUENCER_MANUAL;
    legs(drive, LEG_LOW, 0, LEG_LOW);
    drive_apply_voltage(drive, 0, true);
    enter_phase(drive, START_PRECHARGE);
  }
}

static void align(drive_t *drive, uint32_t leg, uint32_t rise_ticks) {
  const parameters_t *p = drive->p;
  int32_t u = p->align_v_q25;
  if (drive->state_ticks < rise_ticks) {
    u = mul_q16(u, (int32_t)div_sat_u32((uint64_t)drive->state_ticks << 16, rise_ticks));
  }
  legs(drive, LEG_LOW, leg, LEG_PWM_HIGH);
  drive_apply_voltage(drive, u, true);
}

// A load that is stronger than the alignment turns the rotor; the standing voltage would brake it, with a current that grows
// with its speed. With the gates off it coasts, and is caught. True: let go.
static bool let_go(drive_t *drive) {
  const bool over = drive->m.motor_q17 > drive->p->align_limit_q17;
  drive->pulled_ticks = over ? drive->pulled_ticks + 1u : 0u;
  if (drive->pulled_ticks < ALIGN_PULLED_TICKS) {
    return false;
  }
  start_failed(drive);
  drive->pulled_out = true;
  return true;
}

// Every failed attempt halves the acceleration of the next: t_1 grows with its square root.
static void choose_acceleration(drive_t *drive) {
  const uint32_t halvings = (drive->failed_starts < HALVINGS_MAX) ? drive->failed_starts : HALVINGS_MAX;
  uint64_t first = (uint64_t)(uint32_t)drive->p->start_first_cycles << (halvings / 2u);
  if (halvings % 2u != 0u) {
    first = (first * SQRT2_Q16) >> 16;
  }
  drive->first_cycles = (first > INTERVAL_MAX) ? INTERVAL_MAX : (uint32_t)first;
  drive->start_accel_rpm_q20 = (drive->p->start_accel_rpm_q20 >> halvings) | 1;
}

// First forced sector: the update that switches the sequencer also starts the forced timer.
static void begin_ramp(drive_t *drive) {
  chip_command_t *command = &drive->command;
  command->sequencer = SEQUENCER_SIX_STEP;
  command->start_sector = start_sector(ALIGN_LEG_SECOND, drive->reverse);
  command->reverse = drive->reverse;
  command->timer = COMMUTATION_FORCED;
  choose_acceleration(drive);
  command->forced_interval_cycles = drive->first_cycles;
  command->miss_limit = 0;
  command->zcd_enable = true;
  // A rotor that leads the forced field by more than the flank's 30 degrees would be computed back to a wrong angle;
  // the crossings have to catch up with it first.
  command->crossing.compute_back = false;
  drive->held_from = UINT32_MAX;
  drive->interval_for = UINT32_MAX;
  handover_reset(&drive->handover, 0, 0);
  ramp_preset(&drive->ramp, 0);
  drive_apply_voltage(drive, drive->p->start_v_q25, true);
  enter_phase(drive, START_RAMP);
}

static void ramp(drive_t *drive, const chip_snapshot_t *in) {
  const parameters_t *p = drive->p;
  const measured_t *m = &drive->m;
  const int32_t end_rpm_q8 = p->handover_rpm * 256;
  const uint32_t forced_before = drive->command.forced_interval_cycles;

  // The interval written now is used by the commutation after the pending one.
  uint32_t interval = (uint32_t)p->handover_interval_cycles;
  if (drive->held_from == UINT32_MAX && m->commutations == drive->interval_for) {
    interval = drive->command.forced_interval_cycles;
  } else if (drive->held_from == UINT32_MAX) {
    drive->interval_for = m->commutations;
    const uint32_t accelerating = forced_interval_cycles(drive->first_cycles, m->commutations);
    if (accelerating > interval) {
      interval = accelerating;
    } else {
      drive->held_from = m->commutations;
    }
  }
  drive->command.forced_interval_cycles = interval;

  (void)ramp_step(&drive->ramp, end_rpm_q8, drive->start_accel_rpm_q20, end_rpm_q8, end_rpm_q8);
  const int32_t speed_rpm_q8 = drive->ramp.value_rpm_q8;
  const int32_t u = p->start_v_q25 + gain_apply(speed_rpm_q8, p->start_emf);
  drive_apply_voltage(drive, u, true);

  if (drive->held_from == UINT32_MAX) {
    handover_reset(&drive->handover, in->crossings, in->late);
    return;
  }
  handover_step(&drive->handover, in->crossings, in->late, in->zc_interval_cycles, forced_before,
                (uint32_t)p->handover_tolerance_q16);
  const uint32_t held = m->commutations - drive->held_from;
  const uint32_t wanted = (uint32_t)p->handover_crossings;
  if (drive->handover.clean >= wanted ||
      (held >= (uint32_t)p->handover_fallback && drive->handover.plausible >= wanted)) {
    begin_lock(drive);
  } else if (held >= (uint32_t)p->handover_timeout) {
    start_failed(drive);
  }
}

// Crossings commutate at held voltage until the period consists of them alone.
static void lock(drive_t *drive) {
  const parameters_t *p = drive->p;
  const measured_t *m = &drive->m;
  if (m->speed_valid && drive_outruns_voltage(drive, 0)) {
    start_failed(drive);
    return;
  }
  const bool enough = m->crossings - drive->locked_from >= (uint32_t)p->lock_crossings &&
                      drive->state_ticks > RUN_PREPARE_TICKS;
  if (enough && m->speed_rpm_q8 > p->handover_rpm * 128 && m->speed_rpm_q8 / 256 < p->overspeed_rpm) {
    run_begin(drive);
    return;
  }
  run_prepare(drive);
  if (drive->state_ticks > (uint32_t)p->lock_timeout_ticks) {
    start_failed(drive);
  }
}

// From standstill by the edges: the sensors' sector pulls at once, its edges commutate.
static void begin_hall(drive_t *drive) {
  direct(drive, drive->settings.target_rpm < 0);
  drive->command.sequencer = SEQUENCER_SIX_STEP;
  drive->command.zcd_enable = true;
  drive->locked_from = drive->hall.edge_count;
  drive_apply_voltage(drive, drive->p->start_v_q25, true);
  enter_phase(drive, START_HALL);
}

static void hall(drive_t *drive, const chip_snapshot_t *in) {
  const parameters_t *p = drive->p;
  const measured_t *m = &drive->m;
  const uint32_t interval = hall_interval_cycles(drive, in, drive->locked_from);
  const int32_t speed_rpm_q8 =
      (interval > 0u) ? speed_from_period_rpm_q8(drive->speed_numerator_q8, 6u * interval) : 0;
  drive_apply_voltage(drive, p->start_v_q25 + gain_apply(speed_rpm_q8, p->start_emf), true);
  const bool enough = drive->hall.edge_count - drive->locked_from > (uint32_t)p->lock_crossings &&
                      drive->state_ticks > RUN_PREPARE_TICKS && interval > 0u && m->speed_valid;
  if (enough && m->speed_rpm_q8 > p->handover_rpm * 256) {
    run_begin(drive);
    return;
  }
  run_prepare(drive);
  if (drive->state_ticks > (uint32_t)p->hall_start_ticks) {
    start_failed(drive);
  }
}

COLD void start_step(drive_t *drive, const chip_snapshot_t *in) {
  const parameters_t *p = drive->p;
  switch (drive->phase) {
    case START_COAST:
      coast(drive, in);
      break;
    case START_PRECHARGE:
      if (drive->state_ticks < (uint32_t)p->precharge_ticks) {
        break;
      }
      if (drive->hall.driving) {
        begin_hall(drive);
      } else {
        enter_phase(drive, START_ALIGN_FIRST);
        align(drive, ALIGN_LEG_FIRST, (uint32_t)p->align_ramp_ticks);
      }
      break;
    case START_ALIGN_FIRST:
      if (let_go(drive)) {
        break;
      }
      align(drive, ALIGN_LEG_FIRST, (uint32_t)p->align_ramp_ticks);
      if (drive->state_ticks >= (uint32_t)p->align_ticks) {
        enter_phase(drive, START_ALIGN_SECOND);
      }
      break;
    case START_ALIGN_SECOND:
      if (let_go(drive)) {
        break;
      }
      align(drive, ALIGN_LEG_SECOND, 0);
      if (drive->state_ticks >= (uint32_t)p->align_ticks) {
        begin_ramp(drive);
      }
      break;
    case START_RAMP:
      ramp(drive, in);
      break;
    case START_LOCK:
      lock(drive);
      break;
    case START_HALL:
      hall(drive, in);
      break;
    default:
      drive_enter_fault(drive, FAULT_START_FAILED);
      break;
  }
}
