// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "app/telemetry.h"

#include <stddef.h>

#include "control/placement.h"
#include "ram.h"

_Static_assert(RAM_TELEMETRY + offsetof(telemetry_t, published_q32) == RAM_PUBLISHED, "the simulator reads it there");
#define IS_WORD(field, word) (offsetof(telemetry_t, field) == 4u * (word))
_Static_assert(IS_WORD(state, 4u) && IS_WORD(fault, 6u) && IS_WORD(limit, 7u) && IS_WORD(speed_rpm_q8, 8u) &&
                   IS_WORD(reference_rpm_q8, 9u) && IS_WORD(target_rpm, 10u) && IS_WORD(lost_locks, 19u),
               "the simulator reads them there (log_update)");

const char *handler_name(handler_t handler) {
  static const char *const names[HANDLER_COUNT] = {
      [HANDLER_CONTROL] = "control", [HANDLER_CONTROL_ENTRY] = "control_entry",
      [HANDLER_TRIP] = "trip",       [HANDLER_UART] = "uart",                   [HANDLER_LOAD] = "load",
      [HANDLER_DESIGN] = "design",   [HANDLER_IDLE] = "idle",
  };
  return names[handler];
}

void telemetry_init(telemetry_t *telemetry) {
  *telemetry = (telemetry_t){.magic = TELEMETRY_MAGIC, .length_bytes = sizeof *telemetry};
  for (uint32_t h = 0; h < HANDLER_COUNT; h++) {
    cycles_reset(&telemetry->handler[h]);
  }
}

SHARED void telemetry_update(telemetry_t *telemetry, const drive_t *drive) {
  const report_t *report = drive->report;
  telemetry->tick = drive->order.tick;
  telemetry->state = (uint32_t)drive->order.state;
  telemetry->phase = (uint32_t)report->phase;
  telemetry->fault = (uint32_t)drive->fault;
  telemetry->limit = (uint32_t)report->limit;
  telemetry->speed_rpm_q8 = report->speed_rpm_q8;
  telemetry->reference_rpm_q8 = report->demand_rpm_q8;
  telemetry->target_rpm = drive->settings.target_rpm;
  telemetry->u_v_q25 = report->voltage_v_q25;
  telemetry->duty_q30 = report->duty_q30;
  telemetry->period_cycles = report->period_cycles;
  telemetry->vdc_v_q25 = report->vdc_v_q25;
  telemetry->idc_q17 = report->idc_q17;
  telemetry->motor_q17 = report->motor_q17;
  telemetry->crossings = report->crossings;
  telemetry->commutations = report->six_step.commutations;
  telemetry->lost_locks = drive->lost_locks;
  telemetry->fault_count = drive->log.count;
}

HOT void telemetry_update_vector(telemetry_t *telemetry, const vector_report_t *vector) {
  telemetry->angle_turn_q32 = vector->angle_turn_q32;
  telemetry->speed_turn_q36 = vector->speed_turn_q36;
  telemetry->d_i_q17 = vector->current_i_q17.re;
  telemetry->q_i_q17 = vector->current_i_q17.im;
  telemetry->emf_v_q25 = vector->emf_v_q25;
  telemetry->observed_ahead_q30 = vector->observed_ahead_q30;
  telemetry->encoder_ahead_q30 = vector->encoder_ahead_q30;
  telemetry->encoder_faults = vector->encoder_faults;
  telemetry->published_q32 = vector->published_q32;
}
