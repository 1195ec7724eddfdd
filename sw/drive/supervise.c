// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "drive/supervise.h"

#include "control/placement.h"

#define SILENT_TICKS 3u
// Ticks after a clear in which the latched trips may still be the old ones.
#define CLEAR_TICKS 2u
// Trips that mean nothing while the gates are off anyway.
#define TRIPS_OF_RUNNING (TRIP_LOST_LOCK | TRIP_UNDER_VOLTAGE)

void supervise_renew(supervise_t *supervise) { supervise->excused = false; }

// What an over-current of a drive comes from whose angle is in doubt.
static fault_t doubted(const parameters_t *p) {
  if (!method_is_vector(p->method)) {
    return FAULT_HALL_SENSOR;
  }
  return (p->vector_angle != 0) ? FAULT_ENCODER : FAULT_ANGLE_LOST;
}

// A drive that has lost its lock drives current against the EMF: an over-current then is its consequence, not a fault of
// its own. A short circuit looks the same: once may be chance.
COLD static bool excuses_over_current(supervise_t *supervise, const order_t *order, bool lost) {
  if (order->state != STATE_STARTING && order->state != STATE_RUNNING) {
    return false;
  }
  const bool excused = !supervise->excused && lost;
  supervise->excused = supervise->excused || excused;
  return excused;
}

// A rotor that jams loses its lock without a missed crossing; soon after a start there has been no lock.
COLD static outcome_t lose_lock(const parameters_t *p, const order_t *order, bool impossible) {
  const bool soon = order->state == STATE_RUNNING && order->state_ticks < (uint32_t)p->restart_clear_ticks;
  return outcome_of((impossible && soon) ? EVENT_LOCK_NEVER : EVENT_LOCK_LOST);
}

// Gates are off already when a trip is seen here: this gives it its name. Only what is explained is cleared unnamed by the
// restart: the lost lock itself, a link that falls after another trip, which the start judges, and an over-current that is
// excused. A drive that is ready has no lock to lose.
COLD static outcome_t judge_trips(supervise_t *supervise, const parameters_t *p, const chip_snapshot_t *in,
                                  const order_t *order, const report_t *report, bool excused) {
  const bool ready = order->state == STATE_READY;
  const bool coasting = order->state == STATE_STARTING && report->phase == START_COAST;
  const bool clearing = coasting && order->state_ticks <= CLEAR_TICKS;
  const uint32_t counts = ready ? ~(uint32_t)TRIPS_OF_RUNNING : UINT32_MAX;
  const uint32_t latched = in->trip_latched & counts;
  const uint32_t first = ((in->trip_first != 0u) ? in->trip_first : in->trip_latched) & counts;
  if (latched == 0u || clearing) {
    return outcome_of(EVENT_STAY);
  }
  uint32_t explained = ready ? 0u : (uint32_t)TRIP_LOST_LOCK | ((uint32_t)TRIP_UNDER_VOLTAGE & ~first);
  const uint32_t over_current = in->trip_latched & TRIPS_OF_CURRENT;
  fault_t passed = FAULT_NONE;
  if (!ready && over_current != 0u) {
    const bool lost =
        report->impossible || (in->trip_first & TRIP_LOST_LOCK) != 0u || excused;
    if (excuses_over_current(supervise, order, lost)) {
      explained |= TRIPS_OF_CURRENT;
      passed = fault_of_trip(over_current);
    }
  }
  const uint32_t rest = latched & ~explained;
  outcome_t outcome = lose_lock(p, order, report->impossible);
  if (rest != 0u) {
    const uint32_t causes = ((first & rest) != 0u) ? first & rest : rest;
    const bool deadline = (causes & ~(uint32_t)TRIP_DEADLINE) == 0u;
    const fault_t fault = deadline ? fault_of_monitor(in->trip_monitor) : fault_of_trip(causes);
    const bool explained_by = fault_is_over_current(fault) && report->doubtful;
    const bool pulses = report->phase == START_INSULATION || report->phase == START_WIRING;
    const bool shorted = fault_is_over_current(fault) && order->state == STATE_STARTING && pulses;
    passed = (explained_by || shorted) ? fault : passed;
    outcome = outcome_fault(shorted ? FAULT_SHORTED_WINDING : explained_by ? doubted(p) : fault);
  }
  return outcome_passing(outcome, passed);
}

HOT outcome_t supervise_step(supervise_t *supervise, const parameters_t *p, const chip_snapshot_t *in,
                             const order_t *order, const report_t *report, bool excused) {
  if (order->state == STATE_INIT || order->state == STATE_FAULT) {
    return outcome_of(EVENT_STAY);
  }
  if (report->silent_ticks >= SILENT_TICKS) {
    return outcome_fault(FAULT_NO_SAMPLES);
  }
  // Before anything that starts anew, and clears.
  if (in->trip_latched != 0u) {
    const outcome_t outcome = judge_trips(supervise, p, in, order, report, excused);
    if (outcome_event(outcome) != EVENT_STAY) {
      return outcome;
    }
  }
  if (report->impossible) {
    return lose_lock(p, order, true);
  }
  return report->over ? outcome_fault(FAULT_OVERSPEED) : outcome_of(EVENT_STAY);
}
