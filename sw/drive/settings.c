// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

#include "drive/settings.h"

#include <stddef.h>

#include "control/fixed.h"
#include "control/placement.h"

SMALL_CODE_BEGIN

static const setting_row_t rows[SETTING_COUNT] = SETTING_ROWS;

const setting_row_t *setting_row(setting_t setting) { return &rows[setting]; }

bool setting_is_known(const parameters_t *p, setting_t setting) {
  return (rows[setting].flags & 1u << (uint32_t)p->method) != 0u;
}

int32_t current_q17_of_ma(const parameters_t *p, int32_t milliamp) {
  if (milliamp <= 0) {
    return 0;
  }
  const uint64_t scaled = (uint64_t)(uint32_t)milliamp << 17;
  return clamp_i32(sat_i32((int64_t)div_u64(scaled, (uint32_t)p->current_full_scale_ma)), 0, SAMPLE_MAX_Q17);
}

int32_t current_ma_of_q17(const parameters_t *p, int32_t i_q17) {
  return sat_i32(round_shift((int64_t)i_q17 * p->current_full_scale_ma, 17));
}

int32_t torque_unm_of_current(const parameters_t *p, int32_t i_q25) {
  // Division by mant * 2^-shift, the mantissa normalised to 31 bits: shifted so far that nothing is lost or overflows.
  const gain_t g = p->torque_to_current;
  const uint32_t size = (uint32_t)abs_sat(i_q25);
  if (g.mant <= 0) {
    return 0;
  }
  if (g.shift > 37) {
    return INT32_MAX;
  }
  const uint64_t scaled = ((uint64_t)size << g.shift) + (uint32_t)g.mant / 2u;
  const int32_t unm = sat_i32((int64_t)(div_u64(scaled, (uint32_t)g.mant) & INT64_MAX));
  return (i_q25 < 0) ? -unm : unm;
}

// Setters and getters of what is not stored in the unit of its number: set_NAME, get_NAME, as the table names them.

static bool set_speed_rpm(settings_t *s, const parameters_t *p, int32_t rpm) {
  if (rpm > p->speed_max_rpm || rpm < -p->speed_max_rpm) {
    return false;
  }
  s->target_rpm = rpm;
  s->line = false;
  return true;
}

static bool set_accel_rpm_s(settings_t *s, const parameters_t *p, int32_t rpm_s) {
  // Change a tick, 2^-20 r/min: rpm_s * 2^20 * tick_cycles / clock_hz.
  const uint64_t numerator = (uint64_t)(uint32_t)rpm_s * (uint32_t)p->tick_cycles;
  const uint64_t whole = div_u64(numerator, (uint32_t)p->clock_hz);
  const uint64_t rest = numerator - whole * (uint32_t)p->clock_hz;
  const uint64_t step = (whole << 20) + div_u64(rest << 20, (uint32_t)p->clock_hz);
  s->accel_rpm_s = rpm_s;
  s->accel_rpm_q20 = (step > (uint32_t)INT32_MAX) ? INT32_MAX : ((step < 1u) ? 1 : (int32_t)step);
  s->accel_rpm_q8 = gain_apply(rpm_s, p->accel_feed_forward_s);
  return true;
}

static int32_t get_carrier_hz(const settings_t *s, const parameters_t *p) {
  return (int32_t)((uint32_t)p->clock_hz / s->carrier_period_cycles);
}

static bool set_carrier_hz(settings_t *s, const parameters_t *p, int32_t hz) {
  const int32_t period = (p->clock_hz + hz / 2) / hz;
  if (period < 4 * p->min_pulse_cycles || period > p->carrier_longest_cycles) {
    return false;
  }
  s->carrier_period_cycles = (uint32_t)period;
  return true;
}

// A limit above zero and up to the converter's full scale.
static bool set_limit(int32_t *limit_q17, const parameters_t *p, int32_t milliamp) {
  if (milliamp <= 0 || milliamp > p->current_full_scale_ma) {
    return false;
  }
  *limit_q17 = current_q17_of_ma(p, milliamp);
  return true;
}

static int32_t get_current_limit_a(const settings_t *s, const parameters_t *p) {
  return current_ma_of_q17(p, s->current_limit_q17);
}

static bool set_current_limit_a(settings_t *s, const parameters_t *p, int32_t milliamp) {
  return set_limit(&s->current_limit_q17, p, milliamp);
}

static int32_t get_dc_limit_a(const settings_t *s, const parameters_t *p) {
  return current_ma_of_q17(p, s->dc_limit_q17);
}

static bool set_dc_limit_a(settings_t *s, const parameters_t *p, int32_t milliamp) {
  return set_limit(&s->dc_limit_q17, p, milliamp);
}

static int32_t get_brake_limit_a(const settings_t *s, const parameters_t *p) {
  return current_ma_of_q17(p, s->brake_limit_i_q25 / 256);
}

static bool set_brake_limit_a(settings_t *s, const parameters_t *p, int32_t milliamp) {
  int32_t limit_q17;
  if (!set_limit(&limit_q17, p, milliamp)) {
    return false;
  }
  s->brake_limit_i_q25 = limit_q17 * 256;
  return true;
}

// The torque mode needs the current loop.
static bool set_current_loop(settings_t *s, const parameters_t *p, int32_t on) {
  (void)p;
  if (on == 0 && s->mode == MODE_TORQUE) {
    return false;
  }
  s->current_loop = on != 0;
  return true;
}

static bool set_mode(settings_t *s, const parameters_t *p, int32_t mode) {
  (void)p;
  if (mode == MODE_TORQUE && !s->current_loop) {
    return false;
  }
  s->mode = (uint8_t)mode;
  return true;
}

// Target of the torque mode, as a current or as a torque through the machine's constant; at most full scale.
static int32_t get_current_ma(const settings_t *s, const parameters_t *p) {
  return sat_i32(round_shift((int64_t)s->target_i_q25 * p->current_full_scale_ma, 25));
}

static bool set_current_ma(settings_t *s, const parameters_t *p, int32_t milliamp) {
  const uint32_t full_ma = (uint32_t)p->current_full_scale_ma;
  const uint32_t size_ma = (uint32_t)abs_sat(milliamp);
  if (size_ma > full_ma) {
    return false;
  }
  const int32_t i_q25 = (int32_t)div_u64(((uint64_t)size_ma << 25) + full_ma / 2u, full_ma);
  s->target_i_q25 = (milliamp < 0) ? -i_q25 : i_q25;
  return true;
}

static int32_t get_torque_mnm(const settings_t *s, const parameters_t *p) {
  return torque_unm_of_current(p, s->target_i_q25);
}

static bool set_torque_mnm(settings_t *s, const parameters_t *p, int32_t micro_nm) {
  const int32_t i_q25 = gain_apply(micro_nm, p->torque_to_current);
  if (abs_sat(i_q25) > 1 << 25) {
    return false;
  }
  s->target_i_q25 = i_q25;
  return true;
}

static int32_t get_command_timeout_ms(const settings_t *s, const parameters_t *p) {
  const uint64_t cycles = (uint64_t)s->command_timeout_ticks * (uint32_t)p->tick_cycles;
  return (int32_t)div_u64(cycles, (uint32_t)p->clock_hz / 1000u);
}

// Rounded up: a tick at least.
static bool set_command_timeout_ms(settings_t *s, const parameters_t *p, int32_t milliseconds) {
  const uint64_t cycles = (uint64_t)(uint32_t)milliseconds * ((uint32_t)p->clock_hz / 1000u);
  s->command_timeout_ticks = (uint32_t)div_u64(cycles + (uint32_t)p->tick_cycles - 1u, (uint32_t)p->tick_cycles);
  return true;
}

int32_t settings_get(const settings_t *s, const parameters_t *p, setting_t setting) {
  const setting_row_t *row = &rows[setting];
  const uint8_t *member = (const uint8_t *)s + row->offset;
#define X(number, get) \
  case number:         \
    return get(s, p);
  switch (setting) {
    SETTINGS_GET(X)
    default:
      return (row->size == 1u) ? *member : *(const int32_t *)(const void *)member;
  }
#undef X
}

static bool store(settings_t *s, const parameters_t *p, setting_t setting, int32_t value) {
  const setting_row_t *row = &rows[setting];
  uint8_t *member = (uint8_t *)s + row->offset;
#define X(number, set) \
  case number:         \
    return set(s, p, value);
  switch (setting) {
    SETTINGS_SET(X)
    default:
      if (row->size == 1u) {
        *member = (uint8_t)value;
      } else {
        *(int32_t *)(void *)member = value;
      }
      return true;
  }
#undef X
}

setting_result_t settings_set(settings_t *s, const parameters_t *p, setting_t setting, int32_t value) {
  const setting_row_t *row = &rows[setting];
  const bool zero = value == 0 && (row->flags & SETTING_OR_ZERO) != 0u;
  if (!setting_is_known(p, setting)) {
    return SETTING_OF_OTHER_METHOD;
  }
  if (!zero && (value < row->min || value > row->max)) {
    return SETTING_OUT_OF_RANGE;
  }
  return store(s, p, setting, value) ? SETTING_TAKEN : SETTING_OUT_OF_RANGE;
}

void settings_init(settings_t *s, const parameters_t *p) {
  const int32_t *words = (const int32_t *)(const void *)p;
  s->current_limit_q17 = current_q17_of_ma(p, p->current_limit_ma);
  s->dc_limit_q17 = current_q17_of_ma(p, p->dc_current_limit_ma);
  s->brake_limit_i_q25 = current_q17_of_ma(p, p->brake_limit_ma) * 256;
  s->carrier_period_cycles = (uint32_t)p->carrier_period_cycles;
  s->target_i_q25 = p->target_i_q25;
  for (uint32_t n = 0; n < SETTING_COUNT; n++) {
    if (rows[n].parameter != SETTING_NO_PARAMETER) {
      (void)store(s, p, (setting_t)n, words[rows[n].parameter]);
    }
  }
}

SMALL_CODE_END
