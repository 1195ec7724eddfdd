// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "drive/six_step/six_step.h"

#include "control/fixed.h"
#include "control/placement.h"

#define MISSES_BEFORE_TRIP 2u
// 5 ms at 10 kHz, looked at every fourth tick.
#define OUTRUN_TICKS 50u
// 5 ms of a stop in which the shortest pulse drives the rotor.
#define DRIVEN_TICKS 50u
#define OUTRUN_LOOK_TICKS 4u
// 2 ms at 10 kHz: the currents of a trip have ended.
#define STOOD_TICKS 20u
// Of the EMF that belonged to the speed.
#define STOOD_SHARE 4

static six_step_view_t view_of(const six_step_t *six, const chip_snapshot_t *in, const order_t *order, const settings_t *settings) {
  return (six_step_view_t){six->p, settings, order, in, &six->m};
}

static regulate_input_t regulate_input(const six_step_t *six, uint32_t tick) {
  const bool busy = six->thresholds.busy || tick % SIX_STEP_LOOK_TICKS == SIX_STEP_LOOK_AT;
  return (regulate_input_t){six->start.reverse, busy, start_longest_cycles(&six->start, &six->m),
                            six->pwm.period_cycles, six->command.sequence.commutation == COMMUTATION_CSC};
}

void six_step_lost(six_step_t *six) { thresholds_reset(&six->thresholds, &six->command.threshold, six->p); }

static void take_crossing(six_step_t *six, const settings_t *settings) {
  if (sequence_cross(&six->command.sequence, settings)) {
    six_step_lost(six);
  }
}

COLD void six_step_init(six_step_t *six, const parameters_t *p, const settings_t *settings) {
  __builtin_memset(six, 0, sizeof *six);
  six->p = p;
  measure_init(&six->m, p);
  pwm_off(&six->pwm, p);
  regulate_init(&six->regulate, settings);
  sequence_init(&six->command.sequence, settings);
  hall_init(&six->hall, p);
  six_step_lost(six);
  six->report.six_step.threshold_q17 = six->command.threshold.q17;
  six->report.six_step.hall_late_q20 = six->hall.late_q20[0];
}

// The law of discontinuous conduction knows the current for the speed's EMF: without EMF the pulse drives a multiple. A
// sample in the pulse is no mean.
HOT static bool outruns_pulse(const six_step_t *six) {
  const regulate_t *r = &six->regulate;
  const int32_t most_i_q25 = clamp_i32(r->reference_i_q25, r->scheduled.least_i_q25, PRODUCT_MAX / 4) * 4;
  return six->p->sample_mode == SAMPLING_CONTINUOUS && six->m.line_i_q25 > most_i_q25;
}

// No rotor turns at the measured speed.
HOT static bool speed_impossible(six_step_t *six, uint32_t tick, bool over) {
  if (tick % OUTRUN_LOOK_TICKS != 0u && !over) {
    return false;
  }
  // The phases' current is right however seldom it is sampled.
  const measured_t *m = &six->m;
  const int32_t line_i_q25 = ((m->idc_q17 > 0) ? m->motor_q17 : -m->motor_q17) * 256;
  const int32_t drop_v_q25 = gain_apply(line_i_q25, six->regulate.scheduled.resistance);
  const bool outruns =
      six->command.sequence.timer == COMMUTATION_ZCD &&
      (six->pwm.discontinuous ? outruns_pulse(six) : pwm_is_outrun(&six->pwm, m->emf_v_q25, drop_v_q25));
  six->outrun_ticks = outruns ? six->outrun_ticks + OUTRUN_LOOK_TICKS : 0u;
  if (six->outrun_ticks < OUTRUN_TICKS && !(over && outruns)) {
    return false;
  }
  six->outrun_ticks = 0;
  return true;
}

HOT bool six_step_measure(six_step_t *six, const chip_snapshot_t *in, const order_t *order, const settings_t *settings) {
  const measured_t *m = &six->m;
  report_t *report = &six->report;
  six->settings_due = six->settings_due || order->settings_fresh;
  measure_step(&six->m, six->p, settings, in, order->tick, six->command.sequence.timer != COMMUTATION_OFF,
               six->regulate.scheduled.line_ratio_q16);
  if (six->p->hall_mode != HALL_OFF) {
    hall_judge(&six->hall, in, six->start.reverse);
  }
  const bool turning = m->speed_valid && (order->state == STATE_RUNNING || order->state == STATE_STOPPING);
  report->over = turning && m->speed_rpm_q8 / 256 > six->p->overspeed_rpm;
  report->impossible = turning && speed_impossible(six, order->tick, report->over);
  report->doubtful = hall_is_doubtful(&six->hall);
  report->silent_ticks = m->silent_ticks;
  report->vdc_v_q25 = m->vdc_v_q25;
  report->idc_q17 = m->idc_q17;
  report->idc_mean_q17 = m->idc_mean_q17;
  report->motor_q17 = m->motor_q17;
  report->machine_i_q17 = m->motor_q17;
  return true;
}

// Missed crossings or edges that contradict them; an over-current before the lock is there, or as the precharge of a
// restart shorts a rotor whose EMF was not seen. With one voltage channel dead every third crossing is missed, never two
// in a row: all of the last 64 to 128 ticks count.
COLD bool six_step_explains(const six_step_t *six, const chip_snapshot_t *in, const order_t *order) {
  const uint8_t lately = (uint8_t)(in->timeouts - six->m.timeouts_before);
  const bool missed = six->command.sequence.timer == COMMUTATION_ZCD &&
                      (in->misses >= MISSES_BEFORE_TRIP || lately >= MISSES_BEFORE_TRIP);
  const bool unseen = order->restarts > 0u && six->start.phase == START_PRECHARGE;
  const bool early = order->state == STATE_STARTING && (unseen || six->start.phase == START_LOCK);
  return missed || early || hall_blames_crossings(&six->hall, six->p);
}

COLD void six_step_start(six_step_t *six, const order_t *order, const settings_t *settings) {
  if (order->requested) {
    hall_forget(&six->hall);
  } else if (order->again) {
    hall_resort(&six->hall, six->p);
  }
  if (order->requested || order->again) {
    start_let_go(&six->start, 0);
  }
  start_begin(&six->start, &six->hall, &six->command, six->p, settings);
  take_crossing(six, settings);
}

COLD void six_step_off(six_step_t *six) {
  six->ran_v_q17 = six->m.emf_v_q25 / 256;
  sequence_off(&six->command.sequence);
  pwm_off(&six->pwm, six->p);
  start_off(&six->start);
}

// Settings that the console may change while running.
COLD static void apply_settings(six_step_t *six, const settings_t *settings) {
  six->settings_due = false;
  sequence_pattern(&six->command.sequence, settings);
  take_crossing(six, settings);
}

COLD static outcome_t starting_step(six_step_t *six, const six_step_view_t *view) {
  const outcome_t outcome = start_step(&six->start, &six->hall, &six->pwm, &six->command, view);
  const regulate_input_t input = regulate_input(six, view->order->tick);
  if (outcome_event(outcome) == EVENT_STARTED) {
    sequence_force_on_miss(&six->command.sequence, true);
    if (six->command.sequence.timer == COMMUTATION_ZCD) {
      sequence_miss(&six->command.sequence, (uint32_t)six->p->miss_limit);
    }
    sequence_sample(&six->command.sequence, (uint32_t)six->p->sample_mode);
    regulate_begin(&six->regulate, &six->pwm, view, &input);
    start_let_go(&six->start, 0);
    if (six->start.ramps) {
      regulate_unload(&six->regulate);
    }
    apply_settings(six, view->settings);
  } else if (start_prepares(&six->start) && six->start.ticks > 0u) {
    regulate_prepare(&six->regulate, &six->pwm, view, &input, six->start.ticks);
  }
  return outcome;
}

// Who commutates. Without sensors to take over, the hardware stops a drive that has lost its lock.
HOT static outcome_t sensors_step(six_step_t *six, const six_step_view_t *view) {
  sequence_command_t *sequence = &six->command.sequence;
  const hall_advice_t advice =
      hall_step(&six->hall, &six->command.edge, view, six->start.reverse, six->regulate.advance_q16);
  if (advice == HALL_REFUSE) {
    return outcome_passing(outcome_of(EVENT_STAY), FAULT_HALL_SENSOR);
  }
  if (advice != HALL_KEEP) {
    sequence_time(sequence, (advice == HALL_TAKE_OVER) ? COMMUTATION_HALL : COMMUTATION_ZCD);
  }
  if (six->p->hall_mode == HALL_FALLBACK) {
    const uint32_t miss_limit = hall_backs_up(&six->hall, six->p) ? 0u : (uint32_t)six->p->miss_limit;
    if (miss_limit != sequence->miss_limit) {
      sequence_miss(sequence, miss_limit);
    }
  }
  if (advice == HALL_TAKE_OVER) {
    six_step_lost(six);
    return outcome_of(EVENT_LOCK_SAVED);
  }
  return outcome_of(EVENT_STAY);
}

// A carrier that each commutation starts anew gives the sector its number of pulses and the cut one the rest: for a while
// the volt-seconds of a sector do not depend on its length, and the EMF line holds the rotor between such lengths only. A
// rotor that it alone holds, or a light one, gets carriers that run on where a sector has many.
HOT static void align(six_step_t *six, const settings_t *settings) {
  sequence_command_t *sequence = &six->command.sequence;
  const int32_t most = is_firm(settings) ? six->p->firm_restart_carriers : six->p->restart_carriers;
  const uint32_t most_cycles = (uint32_t)most * settings->carrier_period_cycles;
  const uint32_t now_cycles = (sequence->commutation == COMMUTATION_CSC) ? most_cycles : most_cycles / 4u * 3u;
  const bool runs_on = settings->commutation == COMMUTATION_CSC && six->m.sector_cycles > now_cycles;
  sequence_align(sequence, runs_on ? COMMUTATION_NSC : settings->commutation);
}

HOT static void regulate(six_step_t *six, const six_step_view_t *view, int32_t target_rpm_q8) {
  if (view->settings->freeze && view->order->state == STATE_RUNNING) {
    regulate_freeze(&six->regulate);
    return;
  }
  if (six->settings_due) {
    apply_settings(six, view->settings);
  }
  align(six, view->settings);
  const regulate_input_t input = regulate_input(six, view->order->tick);
  regulate_step(&six->regulate, &six->pwm, view, &input, target_rpm_q8);
}

// With diodes the shortest pulse in which a crossing can be seen drives the rotor; a stop that wants less can only let it go.
static bool lets_go(six_step_t *six) {
  const bool driven = six->pwm.at_least && !six->pwm.sync_rect;
  six->driven_ticks = driven ? six->driven_ticks + 1u : 0u;
  if (six->driven_ticks < DRIVEN_TICKS) {
    return false;
  }
  six->driven_ticks = 0;
  return true;
}

static outcome_t stopping_step(six_step_t *six, const six_step_view_t *view) {
  const outcome_t outcome = (six->p->hall_mode != HALL_OFF) ? sensors_step(six, view) : outcome_of(EVENT_STAY);
  regulate(six, view, 0);
  const bool late = view->order->state_ticks > (uint32_t)six->p->stop_timeout_ticks;
  const bool done = late || regulate_nearly_stopped(&six->regulate, view) || lets_go(six);
  return done ? outcome_of(EVENT_STOPPED) : outcome;
}

HOT static outcome_t running_step(six_step_t *six, const six_step_view_t *view) {
  const parameters_t *p = six->p;
  const bool reverse = six->start.reverse;
  const int32_t target_rpm = view->settings->target_rpm;
  outcome_t outcome = outcome_of(EVENT_STAY);
  if (six->command.sequence.timer == COMMUTATION_ZCD) {
    thresholds_step(&six->thresholds, &six->command.threshold, view, reverse, six->command.sequence.crossing.zcd_source);
  }
  if (p->hall_mode != HALL_OFF) {
    outcome = sensors_step(six, view);
  }
  const bool wrong = regulate_turns_wrong(view->settings, reverse);
  const int32_t least_rpm = wrong ? 0 : p->stop_rpm;
  regulate(six, view, clamp_i32(reverse ? -target_rpm : target_rpm, least_rpm, p->speed_max_rpm) * 256);
  if (hall_wants_proof(&six->hall, view) && coast_may_catch(view->order, view->settings)) {
    start_prove(&six->start, &six->hall);
    return outcome_of(EVENT_HANDED_BACK);
  }
  // Reversal: toward standstill, and through it by a new start.
  if (wrong && regulate_nearly_stopped(&six->regulate, view)) {
    start_let_go(&six->start, six->m.emf_v_q25);
    return outcome_of(EVENT_REVERSE);
  }
  return outcome;
}

// The edges that commutate have become useless, stay away, as with a blocked rotor, or lead back. The start has its own
// patience.
COLD static outcome_t sensors_lost(const six_step_t *six, const order_t *order) {
  if (six->hall.faulty) {
    return outcome_fault(FAULT_HALL_SENSOR);
  }
  return outcome_of((order->state == STATE_STARTING) ? EVENT_STAY : EVENT_LOCK_LOST);
}

// With open gates a rotor that turns shows its EMF. One that does not, soon after it was driven at a speed, has been stopped: the
// cause of the over-current.
COLD static outcome_t look_stalled(six_step_t *six, const chip_snapshot_t *in) {
  int32_t v_q17[PHASES];
  const int32_t shown_v_q17 = catch_restore(in->v_q17, six->p->diode_v_q25 / 256, v_q17);
  const bool tripped = (in->trip_latched & TRIPS_OF_CURRENT) != 0u;
  const bool stood = tripped && six->ran_v_q17 / 2 > six->p->catch_v_q17 && shown_v_q17 < six->ran_v_q17 / STOOD_SHARE;
  return outcome_passing(outcome_of(EVENT_STAY), stood ? FAULT_STALLED : FAULT_NONE);
}

HOT outcome_t six_step_step(six_step_t *six, const chip_snapshot_t *in, const order_t *order, const settings_t *settings) {
  const six_step_view_t view = view_of(six, in, order, settings);
  if (order_active(order) && hall_disappoints(&six->hall, six->p)) {
    const outcome_t outcome = sensors_lost(six, order);
    if (outcome_event(outcome) != EVENT_STAY) {
      return outcome;
    }
  }
  switch (order->state) {
    case STATE_STARTING:
      return starting_step(six, &view);
    case STATE_RUNNING:
      return running_step(six, &view);
    case STATE_STOPPING:
      return stopping_step(six, &view);
    case STATE_FAULT:
      return (order->state_ticks == STOOD_TICKS) ? look_stalled(six, in) : outcome_of(EVENT_STAY);
    case STATE_INIT:
    case STATE_READY:
    default:
      return outcome_of(EVENT_STAY);
  }
}

// Unequal phases make slow crossings uneven, and a long interval follows a short one. The hardware's patience from a commutation
// on is 1.5 times the last interval: it becomes 1.3 times the mean one or more, for intervals down to an eighth of it. A turn
// repeats itself: the interval that the next crossing ends is known from there, before its commutation takes the patience over.
HOT static uint32_t timeout_q12(const six_step_t *six, const order_t *order) {
  const uint32_t mean_cycles = six->m.sector_cycles;
  if (order->state == STATE_STARTING) {
    return start_timeout_q12(&six->start);
  }
  if (mean_cycles <= SHORT_TICKS * (uint32_t)six->p->tick_cycles || six->command.sequence.timer != COMMUTATION_ZCD) {
    return COMMUTATION_TIMEOUT_Q12;
  }
  const uint32_t last_cycles = measure_interval_cycles(&six->m, 0);
  const uint32_t next_cycles = measure_interval_cycles(&six->m, TURN_INTERVALS - 1u);
  const uint32_t least_cycles = (next_cycles < last_cycles) ? next_cycles : last_cycles;
  return COMMUTATION_TIMEOUT_Q12 << ((uint32_t)(least_cycles < mean_cycles / 8u * 7u) +
                                     (uint32_t)(least_cycles < mean_cycles / 2u) +
                                     (uint32_t)(least_cycles < mean_cycles / 4u));
}

HOT void six_step_finish(six_step_t *six, const order_t *order) {
  const measured_t *m = &six->m;
  report_t *report = &six->report;
  loop_command_t *loop = &six->command.loop;
  loop->period_cycles = six->pwm.period_cycles;
  loop->pulse_cycles_q8 = six->pwm.pulse_cycles_q8;
  loop->advance_q16 = six->regulate.advance_q16;
  loop->peak_q17 = m->peak_q17;
  loop->timeout_q12 = timeout_q12(six, order);
  sequence_rectify(&six->command.sequence, six->pwm.sync_rect);
  if (order->state != STATE_RUNNING) {
    sequence_refresh(&six->command.sequence);
  }
  const bool running = order->state == STATE_RUNNING || order->state == STATE_STOPPING;
  report->phase = six->start.phase;
  report->gates = six->start.gates;
  report->backward = six->start.reverse;
  report->catches = six->start.catches;
  report->limit = running ? six->regulate.limit : LIMIT_NONE;
  report->demand_rpm_q8 = (order->state == STATE_STARTING) ? six->start.ramp.value_rpm_q8 : six->regulate.ramp.value_rpm_q8;
  report->speed_rpm_q8 = m->speed_rpm_q8;
  report->current_i_q25 = m->line_i_q25;
  report->crossings = m->crossings;
  report->voltage_v_q25 = six->pwm.u_v_q25;
  report->duty_q30 = six->pwm.duty_q30;
  report->period_cycles = six->pwm.period_cycles;
  report->six_step.commutations = m->commutations;
  report->six_step.sector_cycles = m->sector_cycles;
  report->six_step.reference_i_q25 = six->regulate.reference_i_q25;
  report->six_step.hall_late_q20 = six->hall.late_q20[six->start.reverse ? 1 : 0];
  report->six_step.hall_handovers = six->hall.handovers;
  report->six_step.hall_faulty = six->hall.faulty;
  report->six_step.commutated_by = (uint8_t)six->command.sequence.timer;
}
