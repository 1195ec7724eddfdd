// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "app/console_items.h"

#include "app/format.h"
#include "control/fixed.h"
#include "drive/hall.h"
#include "drive/vector_injection.h"
#include "hal/chip.h"
#include "hal/cpu.h"
#include "control/placement.h"

SMALL_CODE_BEGIN

#define LOAD_PERIOD_MIN 500
#define COMMAND_TIMEOUT_MAX_MS 600000

typedef enum {
  ITEM_STATE,
  ITEM_PHASE,
  ITEM_FAULT,
  ITEM_LIMIT,
  ITEM_MEASURED_RPM,
  ITEM_REFERENCE_RPM,
  ITEM_DUTY,
  ITEM_VDC_V,
  ITEM_IDC_A,
  ITEM_MOTOR_A,
  ITEM_LOST_LOCKS,
  ITEM_THRESHOLD_PU,
  ITEM_CATCHES,
  ITEM_LINE_A,
  ITEM_REFERENCE_A,
  ITEM_FREEWHEEL_DEG,
  ITEM_HALL_STATE,
  ITEM_HALL_OFFSET_DEG,
  ITEM_HALL_HANDOVERS,
  ITEM_COMMUTATED_BY,
  ITEM_ID_MA,
  ITEM_IQ_MA,
  ITEM_ANGLE_DEG,
  ITEM_OBSERVED_AHEAD_DEG,
  ITEM_ENCODER_AHEAD_DEG,
  ITEM_ENCODER_FAULTS,
  ITEM_OPEN_PHASES,
  ITEM_INJECTION,
  ITEM_IDLE,
  ITEM_SPEED_RPM,  // from here on settable
  ITEM_ACCEL_RPM_S,
  ITEM_ADVANCE_Q16,
  ITEM_ADVANCE_SPEED_Q16,
  ITEM_ADVANCE_CURRENT_Q16,
  ITEM_COMMUTATION,
  ITEM_PATTERN,
  ITEM_CARRIER_HZ,
  ITEM_SYNC_RECT,
  ITEM_CURRENT_LIMIT_A,
  ITEM_DC_LIMIT_A,
  ITEM_BRAKE_LIMIT_A,
  ITEM_FREEZE,
  ITEM_CATCH,
  ITEM_BALANCE,
  ITEM_LINEARITY,
  ITEM_ZCD_METHOD,
  ITEM_ZCD_SOURCE,
  ITEM_COMPUTE_BACK,
  ITEM_CORRECTION_A,
  ITEM_CURRENT_LOOP,
  ITEM_MODE,
  ITEM_TORQUE_MNM,
  ITEM_CURRENT_MA,
  ITEM_HALL_LEARN,
  ITEM_COMMAND_TIMEOUT_MS,
  ITEM_IRQ_LOAD,
  ITEM_COUNT,
} item_t;

static const char *const item_names[ITEM_COUNT] = {
    [ITEM_STATE] = "state",
    [ITEM_PHASE] = "phase",
    [ITEM_FAULT] = "fault",
    [ITEM_LIMIT] = "limit",
    [ITEM_MEASURED_RPM] = "measured_rpm",
    [ITEM_REFERENCE_RPM] = "reference_rpm",
    [ITEM_DUTY] = "duty",
    [ITEM_VDC_V] = "vdc_v",
    [ITEM_IDC_A] = "idc_a",
    [ITEM_MOTOR_A] = "motor_a",
    [ITEM_LOST_LOCKS] = "lost_locks",
    [ITEM_THRESHOLD_PU] = "threshold_pu",
    [ITEM_CATCHES] = "catches",
    [ITEM_LINE_A] = "line_a",
    [ITEM_REFERENCE_A] = "reference_a",
    [ITEM_FREEWHEEL_DEG] = "freewheel_deg",
    [ITEM_HALL_STATE] = "hall_state",
    [ITEM_HALL_OFFSET_DEG] = "hall_offset_deg",
    [ITEM_HALL_HANDOVERS] = "hall_handovers",
    [ITEM_COMMUTATED_BY] = "commutated_by",
    [ITEM_ID_MA] = "id_ma",
    [ITEM_IQ_MA] = "iq_ma",
    [ITEM_ANGLE_DEG] = "angle_deg",
    [ITEM_OBSERVED_AHEAD_DEG] = "observed_ahead_deg",
    [ITEM_ENCODER_AHEAD_DEG] = "encoder_ahead_deg",
    [ITEM_ENCODER_FAULTS] = "encoder_faults",
    [ITEM_OPEN_PHASES] = "open_phases",
    [ITEM_INJECTION] = "injection",
    [ITEM_IDLE] = "idle",
    [ITEM_SPEED_RPM] = "speed_rpm",
    [ITEM_ACCEL_RPM_S] = "accel_rpm_s",
    [ITEM_ADVANCE_Q16] = "advance_q16",
    [ITEM_ADVANCE_SPEED_Q16] = "advance_speed_q16",
    [ITEM_ADVANCE_CURRENT_Q16] = "advance_current_q16",
    [ITEM_COMMUTATION] = "commutation",
    [ITEM_PATTERN] = "pattern",
    [ITEM_CARRIER_HZ] = "carrier_hz",
    [ITEM_SYNC_RECT] = "sync_rect",
    [ITEM_CURRENT_LIMIT_A] = "current_limit_a",
    [ITEM_DC_LIMIT_A] = "dc_limit_a",
    [ITEM_BRAKE_LIMIT_A] = "brake_limit_a",
    [ITEM_FREEZE] = "freeze",
    [ITEM_CATCH] = "catch",
    [ITEM_BALANCE] = "balance",
    [ITEM_LINEARITY] = "linearity",
    [ITEM_ZCD_METHOD] = "zcd_method",
    [ITEM_ZCD_SOURCE] = "zcd_source",
    [ITEM_COMPUTE_BACK] = "compute_back",
    [ITEM_CORRECTION_A] = "correction_a",
    [ITEM_CURRENT_LOOP] = "current_loop",
    [ITEM_MODE] = "mode",
    [ITEM_TORQUE_MNM] = "torque_mnm",
    [ITEM_CURRENT_MA] = "current_ma",
    [ITEM_HALL_LEARN] = "hall_learn",
    [ITEM_COMMAND_TIMEOUT_MS] = "command_timeout_ms",
    [ITEM_IRQ_LOAD] = "irq_load",
};
static const char *const commutation_names[] = {"RSC", "NSC", "CSC"};
static const char *const pattern_names[] = {"ON-PWM", "H_PWM-L_ON", "PWM-ON", "H_ON-L_PWM"};

static const char *const balance_names[] = {"none", "vertical", "both"};
static const char *const mode_names[] = {"speed", "torque"};
static const char *const method_names[] = {"first", "interpolated", "averaged"};
static const char *const timer_names[] = {"none", "clock", "crossings", "hall"};
static const char *const source_names[] = {"terminal", "star_point", "mean"};

static item_t find(const char *name) {
  uint32_t item = 0;
  while (item < ITEM_COUNT && !text_equal(name, item_names[item])) {
    item++;
  }
  return (item_t)item;
}

static void amperes(char *text, const parameters_t *p, int32_t current_q17) {
  format_milli(text, sat_i32(round_shift((int64_t)current_q17 * p->current_full_scale_ma, 17)));
}

// Six numbers, separated by blanks: value * scale / 2^fraction_bits.
static void six_numbers(char *text, const int32_t values[SECTORS], int32_t scale, uint32_t fraction_bits,
                        uint32_t decimals) {
  for (uint32_t sector = 0; sector < SECTORS; sector++) {
    format_fixed(text, (int64_t)values[sector] * scale, fraction_bits, decimals);
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
  const uint32_t sector_cycles = app->drive.m.sector_cycles;
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

static bool with_vectors(const drive_t *d) { return method_is_vector(d->p->method); }

// Settings that the vector drive knows too.
static bool for_vectors(item_t item) {
  return item == ITEM_SPEED_RPM || item == ITEM_ACCEL_RPM_S || item == ITEM_CURRENT_LIMIT_A ||
         item == ITEM_BRAKE_LIMIT_A || item == ITEM_CATCH || item == ITEM_COMMAND_TIMEOUT_MS || item == ITEM_IRQ_LOAD;
}

static void degrees_of_radians(char *text, int32_t angle_q30) {
  format_fixed(text, ((int64_t)angle_q30 * DEGREES_Q16) >> 16, 30, 2);
}

// Share of the current that the validity permits, noise of the angle in degrees, seen ratio of the inductances, share of
// the EMF.
static const char *injection(char *text, const vector_injection_t *j) {
  if (j == 0) {
    return "none";
  }
  const injection_validity_t *validity = &j->frame.validity;
  const uint32_t values_q16[] = {validity->share_q16, validity->noise_q16, validity->ratio_q16,
                                 (uint32_t)j->frame.handover.share_q16};
  char *at = text;
  for (uint32_t k = 0; k < sizeof values_q16 / sizeof values_q16[0]; k++) {
    const int64_t value_q16 = (int64_t)values_q16[k];
    format_fixed(at, (k == 1u) ? (value_q16 * DEGREES_Q16) >> 16 : value_q16, 16, 3);
    at = next_to(at);
  }
  at[-1] = '\0';
  return text;
}

static const char *open_phases(char *text, const vector_injection_t *j) {
  const uint32_t open = (j == 0) ? 0u : j->open.open;
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

static void milliamperes(char *text, const parameters_t *p, int32_t current_q17) {
  format_i32(text, sat_i32(round_shift((int64_t)current_q17 * p->current_full_scale_ma, 17)));
}

// Value as text; names are copied by the caller, so the buffer only holds numbers.
static const char *value_text(const app_t *app, item_t item, char *text) {
  const drive_t *d = &app->drive;
  const settings_t *s = &d->settings;
  const parameters_t *p = d->p;
  switch (item) {
    case ITEM_STATE:
      return drive_state_name(d->state);
    case ITEM_PHASE:
      return (d->state == STATE_STARTING) ? drive_phase_name(d->phase) : "none";
    case ITEM_FAULT:
      return fault_name(d->fault);
    case ITEM_LIMIT:
      return drive_limit_name(d->limit);
    case ITEM_COMMUTATION:
      return commutation_names[s->commutation];
    case ITEM_PATTERN:
      return pattern_names[s->pattern];
    case ITEM_MEASURED_RPM:
      format_fixed(text, d->reverse ? -(int64_t)d->m.speed_rpm_q8 : d->m.speed_rpm_q8, 8, 1);
      break;
    case ITEM_REFERENCE_RPM:
      format_fixed(text, d->reverse ? -(int64_t)d->ramp.value_rpm_q8 : d->ramp.value_rpm_q8, 8, 1);
      break;
    case ITEM_DUTY:
      format_fixed(text, d->duty_q30, 30, 4);
      break;
    case ITEM_VDC_V:
      format_milli(text, sat_i32(round_shift((int64_t)d->m.vdc_v_q25 * p->voltage_full_scale_mv, 25)));
      break;
    case ITEM_IDC_A:
      amperes(text, p, d->m.idc_q17);
      break;
    case ITEM_MOTOR_A:
      amperes(text, p, d->m.motor_q17);
      break;
    case ITEM_LOST_LOCKS:
      format_u32(text, d->lost_locks);
      break;
    case ITEM_BALANCE:
      return balance_names[s->balance];
    case ITEM_THRESHOLD_PU:
      six_numbers(text, d->command.threshold_q17, 1, 17, 4);
      break;
    case ITEM_IDLE:
      format_u32(text, app->idle_cycles);
      format_u32(next_to(text), app->polled);
      break;
    case ITEM_CATCHES:
      format_u32(text, d->catches);
      break;
    case ITEM_CATCH:
      format_u32(text, s->catch_rotor ? 1u : 0u);
      break;
    case ITEM_BRAKE_LIMIT_A:
      amperes(text, p, s->brake_limit_i_q25 / 256);
      break;
    case ITEM_LINE_A:
      amperes(text, p, d->m.line_i_q25 / 256);
      break;
    case ITEM_REFERENCE_A:
      amperes(text, p, d->reference_i_q25 / 256);
      break;
    case ITEM_FREEWHEEL_DEG:
      return freewheel(text, app);
    case ITEM_HALL_STATE:
      return hall_state_name(d);
    case ITEM_HALL_OFFSET_DEG:
      six_numbers(text, d->hall.late_q20[d->reverse ? 1 : 0], 60, 20, 2);
      break;
    case ITEM_HALL_HANDOVERS:
      format_u32(text, d->hall.handovers);
      break;
    case ITEM_COMMUTATED_BY:
      return timer_names[d->command.timer];
    case ITEM_ID_MA:
      milliamperes(text, p, d->vector.current_i_q17.re);
      break;
    case ITEM_IQ_MA:
      milliamperes(text, p, d->vector.current_i_q17.im);
      break;
    case ITEM_ANGLE_DEG:
      format_fixed(text, (int64_t)d->vector.angle_turn_q32 * 360, 32, 1);
      break;
    case ITEM_OBSERVED_AHEAD_DEG:
      degrees_of_radians(text, d->vector.observed_ahead_q30);
      break;
    case ITEM_ENCODER_AHEAD_DEG:
      degrees_of_radians(text, d->vector.encoder_ahead_q30);
      break;
    case ITEM_ENCODER_FAULTS:
      format_u32(text, d->vector.encoder_faults);
      break;
    case ITEM_OPEN_PHASES:
      return open_phases(text, d->vector.injection);
    case ITEM_INJECTION:
      return injection(text, d->vector.injection);
    case ITEM_HALL_LEARN:
      format_u32(text, s->hall_learn ? 1u : 0u);
      break;
    case ITEM_LINEARITY:
      format_u32(text, s->linearity ? 1u : 0u);
      break;
    case ITEM_ZCD_METHOD:
      return method_names[s->crossing.method];
    case ITEM_ZCD_SOURCE:
      return source_names[s->crossing.source];
    case ITEM_COMPUTE_BACK:
      format_u32(text, s->crossing.compute_back ? 1u : 0u);
      break;
    case ITEM_CORRECTION_A:
      format_u32(text, s->crossing.correction_a ? 1u : 0u);
      break;
    case ITEM_CURRENT_LOOP:
      format_u32(text, s->current_loop ? 1u : 0u);
      break;
    case ITEM_MODE:
      return mode_names[s->torque_mode ? 1 : 0];
    case ITEM_TORQUE_MNM:
      format_milli(text, drive_torque_unm(p, s->target_i_q25));
      break;
    case ITEM_CURRENT_MA:
      format_i32(text, sat_i32(round_shift((int64_t)s->target_i_q25 * p->current_full_scale_ma, 25)));
      break;
    case ITEM_SPEED_RPM:
      format_i32(text, s->target_rpm);
      break;
    case ITEM_ACCEL_RPM_S:
      format_i32(text, s->accel_rpm_s);
      break;
    case ITEM_ADVANCE_Q16:
      format_i32(text, s->advance_q16);
      break;
    case ITEM_ADVANCE_SPEED_Q16:
      format_i32(text, s->advance_speed_q16);
      break;
    case ITEM_ADVANCE_CURRENT_Q16:
      format_i32(text, s->advance_current_q16);
      break;
    case ITEM_CARRIER_HZ:
      format_u32(text, (uint32_t)p->clock_hz / s->carrier_period_cycles);
      break;
    case ITEM_SYNC_RECT:
      format_u32(text, s->sync_rect ? 1u : 0u);
      break;
    case ITEM_CURRENT_LIMIT_A:
      amperes(text, p, s->current_limit_q17);
      break;
    case ITEM_DC_LIMIT_A:
      amperes(text, p, s->dc_limit_q17);
      break;
    case ITEM_FREEZE:
      format_u32(text, s->freeze ? 1u : 0u);
      break;
    case ITEM_COMMAND_TIMEOUT_MS:
      format_u32(text, (uint32_t)div_u64((uint64_t)s->command_timeout_ticks * (uint32_t)p->tick_cycles,
                                         (uint32_t)p->clock_hz / 1000u));
      break;
    case ITEM_IRQ_LOAD:
      format_u32(text, app->load_period_cycles);
      break;
    case ITEM_COUNT:
    default:
      return "?";
  }
  return text;
}

static void print(const app_t *app, item_t item) {
  char text[SECTORS * FORMAT_LENGTH];
  console_put(item_names[item]);
  console_put(" ");
  console_put(value_text(app, item, text));
  console_put("\n");
}

bool items_print(const app_t *app, const char *name) {
  const item_t item = find(name);
  if (item == ITEM_COUNT) {
    return false;
  }
  print(app, item);
  return true;
}

const char *items_print_all(const app_t *app) {
  for (uint32_t item = 0; item < ITEM_COUNT; item++) {
    print(app, (item_t)item);
  }
  return 0;
}

void items_list_settable(const app_t *app) {
  const bool vectors = app->drive.p != 0 && with_vectors(&app->drive);
  for (uint32_t item = ITEM_SPEED_RPM; item < ITEM_COUNT; item++) {
    if (!vectors || for_vectors((item_t)item)) {
      console_put(" ");
      console_put(item_names[item]);
    }
  }
}

// A choice by name or by number.
static bool parse_choice(const char *text, const char *const *names, uint32_t count, uint32_t *choice) {
  int32_t number;
  for (uint32_t i = 0; i < count; i++) {
    if (text_equal(text, names[i])) {
      *choice = i;
      return true;
    }
  }
  if (!parse_i32(text, &number) || number < 0 || (uint32_t)number >= count) {
    return false;
  }
  *choice = (uint32_t)number;
  return true;
}

static bool parse_current(const drive_t *d, const char *text, int32_t *current_q17) {
  int32_t milliamp;
  if (!parse_milli(text, &milliamp) || milliamp <= 0 || milliamp > d->p->current_full_scale_ma) {
    return false;
  }
  *current_q17 = drive_current_q17(d->p, milliamp);
  return true;
}

static bool set_load(app_t *app, int32_t cycles) {
  if (cycles != 0 && cycles < LOAD_PERIOD_MIN) {
    return false;
  }
  app->load_period_cycles = (uint32_t)cycles;
  chip_set_load((uint32_t)cycles);
  return true;
}

static bool set_switch(settings_t *s, item_t item, int32_t value) {
  if (value != 0 && value != 1) {
    return false;
  }
  const bool on = value != 0;
  switch (item) {
    case ITEM_FREEZE:
      s->freeze = on;
      return true;
    case ITEM_SYNC_RECT:
      s->sync_rect = on;
      return true;
    case ITEM_CATCH:
      s->catch_rotor = on;
      return true;
    case ITEM_LINEARITY:
      s->linearity = on;
      return true;
    case ITEM_COMPUTE_BACK:
      s->crossing.compute_back = on;
      return true;
    case ITEM_CORRECTION_A:
      s->crossing.correction_a = on;
      return true;
    case ITEM_HALL_LEARN:
      s->hall_learn = on;
      return true;
    case ITEM_CURRENT_LOOP:
      // The torque mode needs it.
      s->current_loop = on;
      return on || !s->torque_mode;
    default:
      return false;
  }
}

static bool set_advance(settings_t *s, item_t item, int32_t value) {
  if (value < -32768 || value > 32767) {
    return false;
  }
  if (item == ITEM_ADVANCE_Q16) {
    s->advance_q16 = value;
  } else if (item == ITEM_ADVANCE_SPEED_Q16) {
    s->advance_speed_q16 = value;
  } else {
    s->advance_current_q16 = value;
  }
  return true;
}

// Rounded up: a tick at least.
static bool set_command_timeout(const parameters_t *p, settings_t *s, int32_t milliseconds) {
  if (milliseconds < 0 || milliseconds > COMMAND_TIMEOUT_MAX_MS) {
    return false;
  }
  const uint64_t cycles = (uint64_t)(uint32_t)milliseconds * ((uint32_t)p->clock_hz / 1000u);
  s->command_timeout_ticks = (uint32_t)div_u64(cycles + (uint32_t)p->tick_cycles - 1u, (uint32_t)p->tick_cycles);
  return true;
}

static bool set_integer(const drive_t *d, settings_t *s, item_t item, int32_t value) {
  switch (item) {
    case ITEM_SPEED_RPM:
      return settings_target(s, d->p, value);
    case ITEM_ACCEL_RPM_S:
      return settings_accel(s, d->p, value);
    case ITEM_CARRIER_HZ:
      return settings_carrier_hz(s, d->p, value);
    case ITEM_ADVANCE_Q16:
    case ITEM_ADVANCE_SPEED_Q16:
    case ITEM_ADVANCE_CURRENT_Q16:
      return set_advance(s, item, value);
    case ITEM_COMMAND_TIMEOUT_MS:
      return set_command_timeout(d->p, s, value);
    case ITEM_CURRENT_MA:
      return settings_target_current(s, d->p, value);
    default:
      return set_switch(s, item, value);
  }
}

static bool set_value(const drive_t *d, settings_t *s, item_t item, const char *text) {
  int32_t value;
  uint32_t choice;
  switch (item) {
    case ITEM_MODE:
      if (!parse_choice(text, mode_names, 2, &choice) || (choice == 1u && !s->current_loop)) {
        return false;
      }
      s->torque_mode = choice == 1u;
      return true;
    case ITEM_BALANCE:
      if (!parse_choice(text, balance_names, 3, &choice)) {
        return false;
      }
      s->balance = (balance_mode_t)choice;
      return true;
    case ITEM_ZCD_METHOD:
      if (!parse_choice(text, method_names, 3, &choice)) {
        return false;
      }
      s->crossing.method = (uint8_t)choice;
      return true;
    case ITEM_ZCD_SOURCE:
      if (!parse_choice(text, source_names, 3, &choice)) {
        return false;
      }
      s->crossing.source = (uint8_t)choice;
      return true;
    case ITEM_TORQUE_MNM:
      return parse_milli(text, &value) && settings_target_torque(s, d->p, value);
    case ITEM_COMMUTATION:
      return parse_choice(text, commutation_names, 3, &s->commutation);
    case ITEM_PATTERN:
      return parse_choice(text, pattern_names, 4, &s->pattern);
    case ITEM_CURRENT_LIMIT_A:
      return parse_current(d, text, &s->current_limit_q17);
    case ITEM_DC_LIMIT_A:
      return parse_current(d, text, &s->dc_limit_q17);
    case ITEM_BRAKE_LIMIT_A:
      if (!parse_current(d, text, &value)) {
        return false;
      }
      s->brake_limit_i_q25 = value * 256;
      return true;
    default:
      return parse_i32(text, &value) && set_integer(d, s, item, value);
  }
}

const char *items_set(app_t *app, const char *name, const char *value) {
  const item_t item = find(name);
  if (item == ITEM_COUNT) {
    return "unknown name";
  }
  if (item < ITEM_SPEED_RPM) {
    return "cannot be set";
  }
  if (with_vectors(&app->drive) && !for_vectors(item)) {
    return "not with vector control";
  }
  if (item == ITEM_IRQ_LOAD) {
    int32_t cycles;
    return (parse_i32(value, &cycles) && set_load(app, cycles)) ? 0 : "value out of range";
  }
  // The control step only reads the settings: work on a copy, put it in place as a whole.
  settings_t next = app->drive.settings;
  if (!set_value(&app->drive, &next, item, value)) {
    return "value out of range";
  }
  const uint32_t state = critical_enter();
  app->drive.settings = next;
  app->drive.settings_fresh = true;
  critical_leave(state);
  return 0;
}

SMALL_CODE_END
