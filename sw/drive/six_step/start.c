// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "drive/six_step/start.h"

#include "control/fixed.h"
#include "control/placement.h"
#include "control/speed.h"
#include "control/startup.h"
#include "drive/six_step/regulate.h"

#define ALIGN_LEG_FIRST 0u
#define ALIGN_LEG_SECOND 1u
// 1 ms at 10 kHz; the current is filtered.
#define ALIGN_PULLED_TICKS 10u
#define HALVINGS_MAX 4u
// A tick with pulses, ticks without: the current of the pulses is gone.
#define INSULATION_TICKS 4u
#define SQRT2_Q16 92682u
#define INTERVAL_MAX 0xFFFFFFu
#define LOCK_TIMEOUT_Q12 0xFFFFu
#define CAUGHT_TICKS 2u
// A rotor that turns by nearly a whole number of sectors a tick shows few angles: it is taken over at any of them then.
#define SECTOR_WAIT_TICKS 64u
// Beside two sectors at the hand-over speed.
#define PROOF_TICKS 32u
// Hand-over: a speed by this factor beside its own counts, with a late crossing a slower one by that. Commutations at its speed
// after which the attempt has failed.
#define HANDOVER_RANGE 4u
#define LATE_RANGE 2u
#define HANDOVER_TIMEOUT 24u
// Crossings between hand-over or catch and speed control, edges from standstill to it, and the share of the hand-over speed
// that a ramp's crossings must show.
#define LOCK_CROSSINGS 8u
#define HALL_EDGES 12u
#define LOCK_SPEED_Q8 192
// Share of the alignment's limit from which the ramp takes off voltage.
#define RAMP_CURRENT_X8 5
// Share of the EMF at which a rotor was let go to be reversed below which it is not caught the wrong way again.
#define LET_GO_X4 5
// Time in which the lower switches may brake a rotor, share of the alignment's limit below which it stands.
#define BRAKE_TICKS 5000u
#define BRAKED 8

SMALL_CODE_BEGIN
// What a step works with.
typedef struct {
  start_t *s;
  hall_t *h;
  pwm_t *pwm;
  six_step_command_t *command;
  const six_step_view_t *view;
} work_t;

static const outcome_t stay = EVENT_STAY;

static void enter_phase(start_t *s, phase_t phase) {
  s->phase = phase;
  s->ticks = 0;
}

static void apply_voltage(const work_t *w, int32_t u_v_q25, bool sync_rect) {
  pwm_from_voltage(w->pwm, w->view, u_v_q25, sync_rect, start_longest_cycles(w->s, w->view->m));
}

static void direct(start_t *s, hall_t *h, six_step_command_t *command, const parameters_t *p, bool reverse) {
  s->reverse = reverse;
  sequence_direct(&command->sequence, reverse);
  hall_begin(h, &command->edge, p, reverse);
}

static void begin_coast(start_t *s) {
  coast_begin(&s->coast);
  s->caught_ticks = 0;
  s->gates = false;
  s->ramps = false;
  enter_phase(s, START_COAST);
}

void start_begin(start_t *s, hall_t *h, six_step_command_t *command, const parameters_t *p, const settings_t *settings) {
  direct(s, h, command, p, settings->target_rpm < 0);
  hall_coast(h);
  begin_coast(s);
  s->longest_cycles = 0;
  s->pulled_ticks = 0;
  // The edges are measured while the rotor coasts.
  sequence_time(&command->sequence, h->driving ? COMMUTATION_HALL : COMMUTATION_OFF);
}

void start_prove(start_t *s, hall_t *h) {
  hall_await_proof(h);
  begin_coast(s);
}

void start_let_go(start_t *s, int32_t emf_v_q25) { s->let_go_v_q17 = emf_v_q25 / 256 / 4 * LET_GO_X4; }

void start_off(start_t *s) { s->gates = false; }

uint32_t start_timeout_q12(const start_t *s) {
  return (s->ramps && s->phase == START_LOCK) ? LOCK_TIMEOUT_Q12 : COMMUTATION_TIMEOUT_Q12;
}

bool start_prepares(const start_t *s) { return s->phase == START_LOCK || s->phase == START_HALL; }

uint32_t start_longest_cycles(const start_t *s, const measured_t *m) {
  return (s->longest_cycles != 0u && !m->speed_valid) ? s->longest_cycles : m->longest_cycles;
}

// The forced field lags a lightly loaded rotor by up to 90 degrees, its crossings are late ones then and the next
// sectors short until the field has caught up. Intervals mean little meanwhile: nothing commutates blindly on them, and crossings
// that stay away after a ramp only fail the attempt. With a caught rotor the hardware opens the gates.
static void begin_lock(const work_t *w) {
  const parameters_t *p = w->view->p;
  sequence_command_t *sequence = &w->command->sequence;
  sequence_time(sequence, COMMUTATION_ZCD);
  sequence_miss(sequence, w->s->ramps ? 0u : (uint32_t)p->miss_limit);
  sequence_force_on_miss(sequence, false);
  w->s->locked_from = w->view->m->crossings;
  w->s->lock_ticks = 0;
  enter_phase(w->s, START_LOCK);
}

// A rotor that turns fast enough for its crossings is taken over at its speed, where its next tick comes as a sector begins, or
// after long enough a wait. What is written now takes effect at the next tick.
//
// No current: the voltage is the EMF, and the carrier follows from the sector's length, which is not measured yet. Both are
// there before the gates open: on a carrier without a pulse the switches short the EMF, and its current trips in 50 us.
static void follow_caught(const work_t *w) {
  const parameters_t *p = w->view->p;
  start_t *s = w->s;
  const int32_t step_q32 = s->coast.mean_step_q32;
  const uint32_t next = s->coast.rotor.angle + (uint32_t)step_q32;
  const uint32_t interval_cycles = catch_sector_cycles(step_q32, (uint32_t)p->tick_cycles);
  s->longest_cycles =
      clamp_u32(interval_cycles / 6u, w->view->settings->carrier_period_cycles, w->view->m->longest_cycles);
  apply_voltage(w, s->coast.pair_emf_q17 * 256, w->view->settings->sync_rect);
  s->caught_ticks++;
  const bool begins = s->caught_ticks > SECTOR_WAIT_TICKS || catch_begins(next, step_q32 < 0);
  if (s->caught_ticks <= CAUGHT_TICKS || !begins) {
    return;
  }
  sequence_command_t *sequence = &w->command->sequence;
  s->reverse = step_q32 < 0;
  s->gates = true;
  sequence_run(sequence, catch_sector(next, s->reverse));
  sequence_direct(sequence, s->reverse);
  sequence_force(sequence, interval_cycles);
  s->catches++;
  begin_lock(w);
  // The interval is known: a missed crossing is one.
  sequence_force_on_miss(sequence, true);
}

// The same by the edges, which are being measured. True: done.
static bool caught_by_edges(const work_t *w) {
  const parameters_t *p = w->view->p;
  const measured_t *m = w->view->m;
  const settings_t *settings = w->view->settings;
  start_t *s = w->s;
  // The edges need no EMF to be seen. A rotor that turns the wrong way was let go at the stop speed to slow down.
  const bool wrong = w->h->backward != (settings->target_rpm < 0);
  const bool fast = wrong ? m->emf_v_q25 / 256 >= p->catch_v_q17 : m->speed_rpm_q8 >= p->handover_rpm * 256;
  const bool turning = m->speed_valid && !hall_rotor_slow(w->h, p) && fast;
  if (!coast_may_catch(w->view->order, settings) || !turning || m->speed_rpm_q8 / 256 > p->overspeed_rpm ||
      m->vdc_v_q25 == 0) {
    s->caught_ticks = 0;
    return false;
  }
  if (w->h->backward != s->reverse) {
    direct(s, w->h, w->command, p, w->h->backward);
    s->caught_ticks = 0;
    return false;
  }
  // A direction that was set takes effect at the next tick.
  apply_voltage(w, m->emf_v_q25, settings->sync_rect);
  s->caught_ticks++;
  if (s->caught_ticks <= CAUGHT_TICKS) {
    return false;
  }
  s->gates = true;
  hall_pull(w->h);
  sequence_run(&w->command->sequence, w->command->sequence.start_sector);
  s->catches++;
  s->locked_from = m->crossings;
  s->lock_ticks = 0;
  enter_phase(s, START_LOCK);
  return true;
}

static void begin_precharge(const work_t *w) {
  w->s->gates = true;
  sequence_legs(&w->command->sequence, LEG_LOW, 0, LEG_LOW);
  apply_voltage(w, 0, true);
  enter_phase(w->s, START_PRECHARGE);
}

// The lower switches brake a rotor that is slow but turns: what flows tells it.
static bool still_brakes(const work_t *w) {
  return w->view->m->motor_q17 > w->view->p->align_limit_q17 / BRAKED && w->s->ticks < BRAKE_TICKS;
}

static outcome_t judge(const work_t *w, bool calm) {
  start_t *s = w->s;
  const coast_result_t result = coast_judge(&s->coast, w->view->p, w->view->order, calm, w->view->m->vdc_v_q25);
  if (result == COAST_AT_REST) {
    begin_precharge(w);
  }
  return (result == COAST_FAULT) ? outcome_fault(s->coast.fault) : stay;
}

// The EMF of a rotor that spins proves the edges before they commutate. HALL_UNPROVEN: wait for it. A rotor without an EMF, or
// one that is not understood for long, proves nothing.
static hall_verdict_t prove(const work_t *w) {
  const six_step_view_t *view = w->view;
  const parameters_t *p = view->p;
  start_t *s = w->s;
  const coast_t *c = &s->coast;
  if (w->h->proven || s->ticks > PROOF_TICKS + (uint32_t)p->hall_stall_ticks) {
    return HALL_RIGHT;
  }
  if (coast_caught(&s->coast, p, view->order, view->settings, view->m->vdc_v_q25)) {
    return hall_prove_coasting(w->h, view->in, s->reverse, c->rotor.angle, c->mean_step_q32);
  }
  const bool seen = coast_may_catch(view->order, view->settings) && c->line_emf_q17 >= p->catch_v_q17;
  return seen ? HALL_UNPROVEN : HALL_RIGHT;
}

static outcome_t coast_by_edges(const work_t *w) {
  const six_step_view_t *view = w->view;
  if (w->s->ticks > COAST_SETTLE_TICKS) {
    const hall_verdict_t verdict = prove(w);
    if (verdict == HALL_WRONG) {
      return outcome_fault(FAULT_HALL_SENSOR);
    }
    if (verdict == HALL_UNPROVEN || caught_by_edges(w)) {
      return stay;
    }
  }
  return judge(w, w->s->ticks > coast_calm_ticks(view->order) && hall_rotor_slow(w->h, view->p));
}

// Caught the wrong way, a rotor that was let go to be reversed would be let go again.
static bool reverses(const work_t *w) {
  const start_t *s = w->s;
  const bool wrong = regulate_turns_wrong(w->view->settings, s->coast.mean_step_q32 < 0);
  return wrong && s->coast.line_emf_q17 < s->let_go_v_q17;
}

static outcome_t coast(const work_t *w) {
  const six_step_view_t *view = w->view;
  coast_t *c = &w->s->coast;
  coast_see(c, view->p, view->in);
  const winding_verdict_t winding = coast_winding(c, view->order);
  if (winding != WINDING_WHOLE) {
    return (winding == WINDING_SHORTED) ? outcome_fault(FAULT_SHORTED_WINDING) : stay;
  }
  if (w->h->driving) {
    return coast_by_edges(w);
  }
  if (w->s->ticks > COAST_SETTLE_TICKS) {
    if (coast_caught(c, view->p, view->order, view->settings, view->m->vdc_v_q25) && !reverses(w)) {
      follow_caught(w);
      return stay;
    }
    w->s->caught_ticks = 0;
  }
  if (coast_stuck(c, view->p, view->in)) {
    return outcome_fault(FAULT_VOLTAGE_CHANNEL);
  }
  return judge(w, coast_calm(c, view->p, view->order));
}

static void align(const work_t *w, uint32_t leg, uint32_t rise_ticks) {
  if (w->h->driving && 2u * w->s->ticks > (uint32_t)w->view->p->align_ticks) {
    hall_look_aligned(w->h, w->view, w->s->reverse, leg == ALIGN_LEG_SECOND);
  }
  int32_t u = w->view->p->align_v_q25;
  if (w->s->ticks < rise_ticks) {
    u = mul_q16(u, (int32_t)div_sat_u32((uint64_t)w->s->ticks << 16, rise_ticks));
  }
  sequence_legs(&w->command->sequence, LEG_LOW, leg, LEG_PWM_HIGH);
  apply_voltage(w, u, true);
}

// A load that is stronger than the alignment or the short of the lower switches turns the rotor, which they brake with a current
// that grows with its speed. With the gates off it coasts, and is caught. True: let go.
static bool pulled_out(const work_t *w, int32_t limit_q17) {
  const bool over = w->view->m->motor_q17 > limit_q17;
  w->s->pulled_ticks = over ? w->s->pulled_ticks + 1u : 0u;
  return w->s->pulled_ticks >= ALIGN_PULLED_TICKS;
}

// Shortest pulses of each leg in turn against the two others, whose lower switches are on: a whole winding lets little current
// through, a short between two phases or from one to a rail trips.
static void check_insulation(const work_t *w) {
  const uint32_t leg = w->s->ticks / INSULATION_TICKS;
  sequence_legs(&w->command->sequence, LEG_LOW, leg, (w->s->ticks % INSULATION_TICKS == 0u) ? LEG_PWM_HIGH : LEG_LOW);
  pwm_shortest(w->pwm, w->view, start_longest_cycles(w->s, w->view->m));
}

// Every failed attempt halves the acceleration of the next: t_1 grows with its square root.
static void choose_acceleration(start_t *s, const parameters_t *p, const order_t *order) {
  const uint32_t halvings = (order->failed_starts < HALVINGS_MAX) ? order->failed_starts : HALVINGS_MAX;
  uint64_t first = (uint64_t)(uint32_t)p->start_first_cycles << (halvings / 2u);
  if (halvings % 2u != 0u) {
    first = (first * SQRT2_Q16) >> 16;
  }
  s->first_cycles = (first > INTERVAL_MAX) ? INTERVAL_MAX : (uint32_t)first;
  s->accel_rpm_q20 = (p->start_accel_rpm_q20 >> halvings) | 1;
}

// The ramp's voltage goes on with the speed that a rotor in step has by now. A rotor out of step opposes it with less than its
// EMF, or adds it, where little resistance lets much flow: what flows beyond 5/4 of the start current takes off four times what it
// drops in the copper.
static void apply_ramp(const work_t *w) {
  const parameters_t *p = w->view->p;
  start_t *s = w->s;
  const int32_t end_rpm_q8 = p->handover_rpm * 256;
  const gain_t copper_x4 = {p->resistance_low, p->resistance_shift + 6};
  (void)ramp_step(&s->ramp, end_rpm_q8, s->accel_rpm_q20, end_rpm_q8, end_rpm_q8);
  const int32_t over_q17 = clamp_i32(w->view->m->motor_q17 - p->align_limit_q17 / 8 * RAMP_CURRENT_X8, 0, SAMPLE_MAX_Q17);
  const int32_t u = p->start_v_q25 + gain_apply(s->ramp.value_rpm_q8, p->start_emf) - gain_apply(over_q17 * 256, copper_x4);
  apply_voltage(w, clamp_i32(u, 0, INT32_MAX), true);
}

// First forced sector: the update that switches the sequencer also starts the forced timer.
static void begin_ramp(const work_t *w) {
  start_t *s = w->s;
  sequence_command_t *sequence = &w->command->sequence;
  sequence_run(sequence, start_sector(ALIGN_LEG_SECOND, s->reverse));
  sequence_direct(sequence, s->reverse);
  sequence_time(sequence, COMMUTATION_FORCED);
  choose_acceleration(s, w->view->p, w->view->order);
  sequence_force(sequence, s->first_cycles);
  sequence_miss(sequence, 0);
  sequence_never_back(sequence);
  s->held_from = UINT32_MAX;
  s->interval_for = UINT32_MAX;
  s->late_seen = w->view->in->late;
  handover_reset(&s->handover, 0);
  ramp_preset(&s->ramp, 0);
  apply_voltage(w, w->view->p->start_v_q25, true);
  s->ramps = true;
  enter_phase(s, START_RAMP);
}

static outcome_t ramp(const work_t *w) {
  const parameters_t *p = w->view->p;
  const measured_t *m = w->view->m;
  const chip_snapshot_t *in = w->view->in;
  start_t *s = w->s;

  // The interval written now is used by the commutation after the pending one.
  const uint32_t end_cycles = (uint32_t)p->handover_interval_cycles;
  if (s->held_from == UINT32_MAX && m->commutations != s->interval_for) {
    s->interval_for = m->commutations;
    const uint32_t accelerating_cycles = forced_interval_cycles(s->first_cycles, m->commutations);
    s->held_from = (accelerating_cycles > end_cycles) ? UINT32_MAX : m->commutations;
    sequence_force(&w->command->sequence, (accelerating_cycles > end_cycles) ? accelerating_cycles : end_cycles);
  }
  apply_ramp(w);

  // The interval to a late one is the forced one's.
  const uint32_t most = (in->late == s->late_seen) ? HANDOVER_RANGE : LATE_RANGE;
  s->late_seen = in->late;
  const bool shown = handover_step(&s->handover, (uint16_t)m->crossings, m->commutations, in->zc_interval_cycles,
                                   end_cycles / HANDOVER_RANGE, end_cycles * most);
  if (shown) {
    begin_lock(w);
    return stay;
  }
  const bool over = s->held_from != UINT32_MAX && m->commutations - s->held_from >= HANDOVER_TIMEOUT;
  return outcome_of(over ? EVENT_START_FAILED : EVENT_STAY);
}

// Crossings commutate until the period consists of them alone: at the voltage of the ramp, which goes on to its end, or at that
// of the EMF of a caught rotor.
static outcome_t lock(const work_t *w) {
  const parameters_t *p = w->view->p;
  const measured_t *m = w->view->m;
  start_t *s = w->s;
  const bool crossings = w->command->sequence.timer == COMMUTATION_ZCD;
  if (m->speed_valid && crossings && pwm_is_outrun(w->pwm, m->emf_v_q25, 0)) {
    return outcome_of(EVENT_START_FAILED);
  }
  if (s->ramps) {
    apply_ramp(w);
    if (w->view->in->misses >= p->miss_limit) {
      return outcome_of(EVENT_START_FAILED);
    }
  }
  // Gains that were prepared before the first speed are those of a standing rotor.
  s->valid_ticks = m->speed_valid ? s->valid_ticks + 1u : 0u;
  const bool enough = m->crossings - s->locked_from >= LOCK_CROSSINGS && s->valid_ticks > START_PREPARE_TICKS;
  const bool driven = !s->ramps || m->emf_v_q25 / 4 * 3 < w->pwm->u_v_q25;
  const bool fast = m->speed_rpm_q8 > p->handover_rpm * LOCK_SPEED_Q8 && m->speed_rpm_q8 / 256 < p->overspeed_rpm;
  if (enough && driven && fast) {
    return outcome_of(EVENT_STARTED);
  }
  const bool ended = !s->ramps || s->ramp.value_rpm_q8 >= p->handover_rpm * 256;
  s->lock_ticks += ended ? 1u : 0u;
  return outcome_of((s->lock_ticks > (uint32_t)p->lock_timeout_ticks) ? EVENT_START_FAILED : EVENT_STAY);
}

// From standstill by the edges: the sensors' sector pulls at once, its edges commutate.
static void begin_hall(const work_t *w) {
  start_t *s = w->s;
  direct(s, w->h, w->command, w->view->p, w->view->settings->target_rpm < 0);
  sequence_run(&w->command->sequence, w->command->sequence.start_sector);
  hall_pull(w->h);
  s->locked_from = w->h->edge_count;
  apply_voltage(w, w->view->p->start_v_q25, true);
  enter_phase(s, START_HALL);
}

// The rotor is about to be moved.
static void begin_motion(const work_t *w) {
  if (w->h->driving) {
    begin_hall(w);
  } else {
    enter_phase(w->s, START_ALIGN_FIRST);
    align(w, ALIGN_LEG_FIRST, (uint32_t)w->view->p->align_ramp_ticks);
  }
}

// What the pull of a rotor at rest tells about the sensors.
static bool pulls_wrong(const work_t *w) {
  const parameters_t *p = w->view->p;
  const measured_t *m = w->view->m;
  const gain_t copper = {p->resistance_low, p->resistance_shift + 8};
  const int32_t emf_v_q25 = m->speed_valid ? m->emf_v_q25 : 0;
  return hall_pulls_wrong(w->h, w->pwm->u_v_q25, gain_apply(m->motor_q17 * 256, copper), emf_v_q25);
}

static outcome_t hall(const work_t *w) {
  const parameters_t *p = w->view->p;
  const measured_t *m = w->view->m;
  start_t *s = w->s;
  if (pulls_wrong(w)) {
    return outcome_fault(FAULT_HALL_SENSOR);
  }
  if (hall_probe(w->h, p, s->ticks)) {
    enter_phase(s, START_ALIGN_FIRST);
    align(w, ALIGN_LEG_FIRST, (uint32_t)p->align_ramp_ticks);
    return stay;
  }
  const uint32_t interval = hall_interval_cycles(w->h, w->view, s->reverse, s->locked_from);
  const int32_t speed_rpm_q8 =
      (interval > 0u) ? speed_from_period_rpm_q8(m->speed_numerator_q8, 6u * interval) : 0;
  apply_voltage(w, p->start_v_q25 + gain_apply(speed_rpm_q8, p->start_emf), true);
  const bool enough = w->h->edge_count - s->locked_from > HALL_EDGES &&
                      s->ticks > START_PREPARE_TICKS && interval > 0u && m->speed_valid;
  if (enough && m->speed_rpm_q8 > p->handover_rpm * 256) {
    return outcome_of(EVENT_STARTED);
  }
  return outcome_of((s->ticks > (uint32_t)p->hall_start_ticks) ? EVENT_START_FAILED : EVENT_STAY);
}

COLD outcome_t start_step(start_t *s, hall_t *h, pwm_t *pwm, six_step_command_t *command, const six_step_view_t *view) {
  const work_t work = {s, h, pwm, command, view};
  const work_t *w = &work;
  const parameters_t *p = view->p;
  if (view->order->state_ticks > 0u) {
    s->ticks++;
  }
  switch (s->phase) {
    case START_COAST:
      return coast(w);
    case START_PRECHARGE:
      if (pulled_out(w, view->settings->current_limit_q17)) {
        return outcome_of(EVENT_PULLED_OUT);
      }
      if (s->ticks < (uint32_t)p->precharge_ticks || still_brakes(w)) {
        break;
      }
      if (view->order->suspected && s->coast.verdict == WINDING_UNKNOWN) {
        enter_phase(s, START_INSULATION);
        check_insulation(w);
      } else {
        begin_motion(w);
      }
      break;
    case START_INSULATION:
      if (s->ticks < PHASES * INSULATION_TICKS) {
        check_insulation(w);
      } else {
        begin_motion(w);
      }
      break;
    case START_ALIGN_FIRST:
      if (pulled_out(w, p->align_limit_q17)) {
        return outcome_of(EVENT_PULLED_OUT);
      }
      align(w, ALIGN_LEG_FIRST, (uint32_t)p->align_ramp_ticks);
      if (s->ticks >= (uint32_t)p->align_ticks) {
        enter_phase(s, START_ALIGN_SECOND);
      }
      break;
    case START_ALIGN_SECOND:
      if (pulled_out(w, p->align_limit_q17)) {
        return outcome_of(EVENT_PULLED_OUT);
      }
      align(w, ALIGN_LEG_SECOND, 0);
      if (s->ticks < (uint32_t)p->align_ticks) {
        break;
      }
      if (!h->driving) {
        begin_ramp(w);
      } else if (hall_aligns_wrong(h)) {
        return outcome_fault(FAULT_HALL_SENSOR);
      } else {
        begin_hall(w);
      }
      break;
    case START_RAMP:
      return ramp(w);
    case START_LOCK:
      return lock(w);
    case START_HALL:
      return hall(w);
    default:
      return outcome_fault(FAULT_START_FAILED);
  }
  return stay;
}

SMALL_CODE_END
