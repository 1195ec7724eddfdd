// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// What the drive shows to whoever can read its RAM: one structure of plain words at a fixed address.
#ifndef FL_TELEMETRY_H
#define FL_TELEMETRY_H

#include <stdint.h>

#include "app/cycles.h"
#include "drive/drive.h"

#define TELEMETRY_MAGIC 0x464C5854u  // "FLXT"

// Measured handlers. CONTROL_ENTRY is the time from the tick to the first instruction of the control step, IDLE from one
// round of the main loop to the next.
typedef enum {
  HANDLER_CONTROL,
  HANDLER_CONTROL_ENTRY,
  HANDLER_TRIP,
  HANDLER_UART,
  HANDLER_LOAD,
  HANDLER_DESIGN,
  HANDLER_IDLE,
  HANDLER_COUNT,
} handler_t;

typedef struct {
  uint32_t magic;
  uint32_t length_bytes;
  uint32_t published_q32;  // by which the published angle is ahead of the frame's; of use with an injection
  uint32_t tick;
  uint32_t state;  // drive_state_t
  uint32_t phase;  // phase_t
  uint32_t fault;  // fault_t
  uint32_t limit;  // limit_t
  int32_t speed_rpm_q8;
  int32_t reference_rpm_q8;
  int32_t target_rpm;
  int32_t u_v_q25;
  int32_t duty_q30;
  uint32_t period_cycles;
  int32_t vdc_v_q25;
  int32_t idc_q17;
  int32_t motor_q17;
  uint32_t crossings;
  uint32_t commutations;
  uint32_t lost_locks;
  uint32_t fault_count;
  chip_freewheel_t freewheel;  // of the last tick that had a measurement
  uint32_t missed_commits;  // ticks at whose start the last set had not been taken yet
  cycles_t handler[HANDLER_COUNT];
  uint32_t angle_turn_q32;  // vector drive: of the frame at the sample
  int32_t speed_turn_q36;
  int32_t d_i_q17;
  int32_t q_i_q17;
  uint32_t emf_v_q25;
  int32_t observed_ahead_q30;  // of the frame: the observed rotor, sine; at every fourth tick
  int32_t encoder_ahead_q30;   // and that of the encoder, rad
  uint32_t encoder_faults;     // lost steps
} telemetry_t;

const char *handler_name(handler_t handler);

void telemetry_init(telemetry_t *telemetry);
// About 45 clocks.
void telemetry_update(telemetry_t *telemetry, const drive_t *drive);
// What only a vector drive has. About 20 clocks.
void telemetry_update_vector(telemetry_t *telemetry, const vector_report_t *vector);

#endif
