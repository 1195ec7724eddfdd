// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "console/console_items.h"

#include "app/crash.h"
#include "console/format.h"
#include "control/fixed.h"
#include "control/placement.h"
#include "hal/chip.h"
#include "hal/cpu.h"
#include "values_table.h"

SMALL_CODE_BEGIN

static const char *const item_names[ITEM_COUNT] = ITEM_NAMES;
static const char *const timer_names[] = TIMER_WORDS;

static uint32_t find_item(const char *name) {
  uint32_t item = 0;
  while (item < ITEM_COUNT && !text_equal(name, item_names[item])) {
    item++;
  }
  return item;
}

static uint32_t find_setting(const char *name) {
  uint32_t setting = 0;
  while (setting < SETTING_COUNT && !text_equal(name, setting_row((setting_t)setting)->name)) {
    setting++;
  }
  return setting;
}

static void amperes(char *text, const parameters_t *p, int32_t current_q17) {
  format_milli(text, sat_i32(round_shift((int64_t)current_q17 * p->current_full_scale_ma, 17)));
}

// Numbers, separated by blanks: value * scale / 2^fraction_bits.
static void numbers(char *text, const int32_t values[], uint32_t count, int32_t scale, uint32_t fraction_bits,
                    uint32_t decimals) {
  for (uint32_t k = 0; k < count; k++) {
    format_fixed(text, (int64_t)values[k] * scale, fraction_bits, decimals);
    while (*text != '\0') {
      text++;
    }
    *text = ' ';
    text++;
  }
  text[-1] = '\0';
}

// A blank after the text; where the next goes.
static char *next_to(char *text) {
  while (*text != '\0') {
    text++;
  }
  *text = ' ';
  return text + 1;
}

static char *put_degrees(char *text, uint64_t cycles, uint32_t sector_cycles) {
  const uint32_t degrees_q8 = clamp_u32(div_sat_u32(cycles * (60u << 8), sector_cycles), 0, 60u << 8);
  format_fixed(text, degrees_q8, 8, 1);
  return next_to(text);
}

// Mean and largest freewheel angle of the last tick that had one, and the largest one's sector; open ones count as 60.
static const char *freewheel(char *text, const app_t *app) {
  const uint32_t state = critical_enter();
  const chip_freewheel_t f = app->telemetry->freewheel;
  const uint32_t sector_cycles = app->drive.report->six_step.sector_cycles;
  critical_leave(state);
  const uint32_t ended = f.count & 0xFFFFu;
  const uint32_t open = f.count >> 16;
  if (f.count == 0u || sector_cycles == 0u) {
    return "none";
  }
  const uint64_t sum_cycles = f.sum_cycles + (uint64_t)open * sector_cycles;
  char *at = put_degrees(text, div_u64(sum_cycles, ended + open), sector_cycles);
  at = put_degrees(at, f.max & 0xFFFFFFu, sector_cycles);
  format_u32(at, ((f.max >> 24) & 7u) + 1u);
  return text;
}

#define DEGREES_Q16 3754936  // a radian

static void degrees_of_radians(char *text, int32_t angle_q30) {
  format_fixed(text, ((int64_t)angle_q30 * DEGREES_Q16) >> 16, 30, 2);
}

// Share of the current that the validity permits, noise of the angle in degrees, seen ratio of the inductances, share of
// the EMF.
static const char *injection(char *text, const vector_report_t *vector) {
  if (!vector->injects) {
    return "none";
  }
  char *at = text;
  for (uint32_t k = 0; k < 4u; k++) {
    const int64_t value_q16 = (int64_t)vector->injection_q16[k];
    format_fixed(at, (k == 1u) ? (value_q16 * DEGREES_Q16) >> 16 : value_q16, 16, 3);
    at = next_to(at);
  }
  at[-1] = '\0';
  return text;
}

static const char *open_phases(char *text, uint32_t open) {
  char *at = text;
  for (uint32_t x = 0; x < PHASES; x++) {
    if ((open >> x & 1u) != 0u) {
      *at = (char)('A' + (char)x);
      at++;
    }
  }
  *at = '\0';
  return (open == 0u) ? "none" : text;
}

// A table of the wiring's test, row by row.
static const char *wiring(char *text, const app_t *app, bool voltages) {
  const parameters_t *p = app->drive.p;
  const wiring_t *seen = app->drive.report->wiring;
  if (seen == 0 || !seen->known) {
    return "none";
  }
  numbers(text, voltages ? seen->voltage_q17[0] : seen->current_q17[0], WIRING_LEGS * WIRING_LEGS,
          voltages ? p->voltage_full_scale_mv : p->current_full_scale_ma, 17, 3);
  return text;
}

// Zeros of the current sensors.
static void offsets(char *text, const parameters_t *p) {
  chip_snapshot_t seen;
  chip_read_offsets(&seen);
  int32_t code_q4[CURRENT_CHANNELS];
  for (uint32_t k = 0; k < CURRENT_CHANNELS; k++) {
    code_q4[k] = (int32_t)seen.current_code_offset_q4[k] - CODE_MIDDLE_Q4;
  }
  numbers(text, code_q4, CURRENT_CHANNELS, p->current_full_scale_ma, 15, 3);
}

static const char *hall_state_name(const parameters_t *p, bool faulty) {
  if (p->hall_mode == HALL_OFF) {
    return "off";
  }
  return faulty ? "faulty" : "ok";
}

static char *put_hex(char *text, uint32_t value) {
  for (uint32_t k = 0; k < 8u; k++) {
    *text = "0123456789ABCDEF"[value >> (28u - 4u * k) & 15u];
    text++;
  }
  *text = '\0';
  return text;
}

// Reason, number of restarts, mcause, mepc, mtval.
static const char *last_restart(char *text) {
  const crash_t crash = crash_seen();
  char *at = text;
  if (crash.reason == (uint32_t)CRASH_NONE) {
    return "none";
  }
  for (const char *name = fault_name(crash_fault_of((crash_reason_t)crash.reason)); *name != '\0'; name++) {
    *at = *name;
    at++;
  }
  *at = ' ';
  at++;
  format_u32(at, crash.count);
  at = next_to(at);
  format_u32(at, crash.cause);
  at = put_hex(next_to(at), crash.address);
  (void)put_hex(next_to(at), crash.value);
  return text;
}

static void milliamperes(char *text, const parameters_t *p, int32_t current_q17) {
  format_i32(text, sat_i32(round_shift((int64_t)current_q17 * p->current_full_scale_ma, 17)));
}

// Value as text; names are copied by the caller, so the buffer only holds numbers.
static const char *value_text(const app_t *app, item_t item, char *text) {
  const drive_t *d = &app->drive;
  const parameters_t *p = d->p;
  switch (item) {
    case ITEM_STATE:
      return drive_state_name(d->order.state);
    case ITEM_PHASE:
      if (d->fault == FAULT_START_FAILED) {
        return drive_phase_name(d->failed_phase);
      }
      return (d->order.state == STATE_STARTING) ? drive_phase_name(d->report->phase) : "none";
    case ITEM_FAULT:
      return fault_name(d->fault);
    case ITEM_LIMIT:
      return drive_limit_name(d->report->limit);
    case ITEM_MEASURED_RPM:
      format_fixed(text, d->report->backward ? -(int64_t)d->report->speed_rpm_q8 : d->report->speed_rpm_q8, 8, 1);
      break;
    case ITEM_SPEED_KNOWN:
      return d->report->speed_unknown ? "no" : "yes";
    case ITEM_REFERENCE_RPM:
      format_fixed(text, d->report->backward ? -(int64_t)d->report->demand_rpm_q8 : d->report->demand_rpm_q8, 8, 1);
      break;
    case ITEM_DUTY:
      format_fixed(text, d->report->duty_q30, 30, 4);
      break;
    case ITEM_VDC_V:
      format_milli(text, sat_i32(round_shift((int64_t)d->report->vdc_v_q25 * p->voltage_full_scale_mv, 25)));
      break;
    case ITEM_IDC_A:
      amperes(text, p, d->report->idc_q17);
      break;
    case ITEM_MOTOR_A:
      amperes(text, p, d->report->motor_q17);
      break;
    case ITEM_LOST_LOCKS:
      format_u32(text, d->lost_locks);
      break;
    case ITEM_THRESHOLD_PU:
      numbers(text, d->report->six_step.threshold_q17, SECTORS, 1, 17, 4);
      break;
    case ITEM_IDLE:
      format_u32(text, app->idle_cycles);
      format_u32(next_to(text), app->polled);
      break;
    case ITEM_CATCHES:
      format_u32(text, d->report->catches);
      break;
    case ITEM_LINE_A:
      amperes(text, p, d->report->current_i_q25 / 256);
      break;
    case ITEM_REFERENCE_A:
      amperes(text, p, d->report->six_step.reference_i_q25 / 256);
      break;
    case ITEM_FREEWHEEL_DEG:
      return freewheel(text, app);
    case ITEM_HALL_STATE:
      return hall_state_name(p, d->report->six_step.hall_faulty);
    case ITEM_HALL_OFFSET_DEG:
      numbers(text, d->report->six_step.hall_late_q20, SECTORS, 60, 20, 2);
      break;
    case ITEM_HALL_HANDOVERS:
      format_u32(text, d->report->six_step.hall_handovers);
      break;
    case ITEM_COMMUTATED_BY:
      return timer_names[d->report->six_step.commutated_by];
    case ITEM_ID_MA:
      milliamperes(text, p, d->report->vector.current_i_q17.re);
      break;
    case ITEM_IQ_MA:
      milliamperes(text, p, d->report->vector.current_i_q17.im);
      break;
    case ITEM_ANGLE_DEG:
      format_fixed(text, (int64_t)d->report->vector.angle_turn_q32 * 360, 32, 1);
      break;
    case ITEM_OBSERVED_AHEAD_DEG:
      degrees_of_radians(text, d->report->vector.observed_ahead_q30);
      break;
    case ITEM_ENCODER_AHEAD_DEG:
      degrees_of_radians(text, d->report->vector.encoder_ahead_q30);
      break;
    case ITEM_ENCODER_FAULTS:
      format_u32(text, d->report->vector.encoder_faults);
      break;
    case ITEM_OPEN_PHASES:
      return open_phases(text, d->report->vector.open_phases);
    case ITEM_INJECTION:
      return injection(text, &d->report->vector);
    case ITEM_WIRING_MA:
      return wiring(text, app, false);
    case ITEM_WIRING_MV:
      return wiring(text, app, true);
    case ITEM_OFFSET_MA:
      offsets(text, p);
      break;
    case ITEM_RESTART:
      return last_restart(text);
    case ITEM_STACK_BYTES:
      format_u32(text, cpu_stack_bytes());
      break;
    case ITEM_COUNT:
      break;
  }
  return text;
}

static void put_line(line_t *line, const char *name, const char *text) {
  line_put(line, name);
  line_put(line, " ");
  line_put(line, text);
  line_put(line, "\n");
}

static void print_item(const app_t *app, line_t *line, uint32_t item) {
  char text[SECTORS * FORMAT_LENGTH];
  put_line(line, item_names[item], value_text(app, (item_t)item, text));
}

static void print_setting(const app_t *app, line_t *line, uint32_t setting) {
  char text[FORMAT_LENGTH];
  const setting_row_t *row = setting_row((setting_t)setting);
  const int32_t value = settings_get(&app->drive.settings, app->drive.p, (setting_t)setting);
  if (row->choices != 0) {
    put_line(line, row->name, row->choices[value]);
    return;
  }
  if ((row->flags & SETTING_THOUSANDTHS) != 0u) {
    format_milli(text, value);
  } else {
    format_i32(text, value);
  }
  put_line(line, row->name, text);
}

bool items_print(const app_t *app, line_t *line, const char *name) {
  const uint32_t item = find_item(name);
  const uint32_t setting = find_setting(name);
  if (item < ITEM_COUNT) {
    print_item(app, line, item);
  } else if (setting < SETTING_COUNT) {
    print_setting(app, line, setting);
  }
  return item < ITEM_COUNT || setting < SETTING_COUNT;
}

const char *items_print_all(const app_t *app, line_t *line) {
  for (uint32_t item = 0; item < ITEM_COUNT; item++) {
    print_item(app, line, item);
  }
  for (uint32_t setting = 0; setting < SETTING_COUNT; setting++) {
    print_setting(app, line, setting);
  }
  return 0;
}

void items_list_settable(const app_t *app, line_t *line) {
  for (uint32_t setting = 0; setting < SETTING_COUNT; setting++) {
    if (app->drive.p == 0 || setting_is_known(app->drive.p, (setting_t)setting)) {
      line_put(line, " ");
      line_put(line, setting_row((setting_t)setting)->name);
    }
  }
}

// A choice by name, anything by number.
static bool parse(const setting_row_t *row, const char *text, int32_t *value) {
  for (int32_t i = 0; row->choices != 0 && i <= row->max; i++) {
    if (text_equal(text, row->choices[i])) {
      *value = i;
      return true;
    }
  }
  return ((row->flags & SETTING_THOUSANDTHS) != 0u) ? parse_milli(text, value) : parse_i32(text, value);
}

const char *items_set(app_t *app, const char *name, const char *text) {
  const uint32_t setting = find_setting(name);
  int32_t value;
  if (setting == SETTING_COUNT) {
    return (find_item(name) == ITEM_COUNT) ? "unknown name" : "cannot be set";
  }
  if (!setting_is_known(app->drive.p, (setting_t)setting)) {
    return (app->drive.p->method == METHOD_VECTOR) ? "not with vector control" : "not with six-step";
  }
  const bool read = parse(setting_row((setting_t)setting), text, &value);
  return (read && app_set(app, (setting_t)setting, value) == SETTING_TAKEN) ? 0 : "value out of range";
}

SMALL_CODE_END
