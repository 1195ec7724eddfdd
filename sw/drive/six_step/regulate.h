// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Regulation while crossings or edges commutate: from the speed to a current, from the current to the pulse.
//
//   i_ref = J a_ref / k_t + PI(n_ref - n), within [-i_brake, i_limit], without sync_rect within [0, i_limit];
//           torque mode: i_ref given
//   u     = k_e n + R(n) i_ref + PI(i_ref - i)
//
//   speed      Kp = w_b (J / k_t + t_d k_e / R_t),     Ki = Kp w_b / 4
//              firm: Kp = w_b J / k_t + k_e / R_t,     Ki = w_b max(w_b J / (4 k_t), k_e / R_t)
//   current    Kp = R_t - R,                           Ki = R(n) / t_trim;      R_t: damps the rotor on the EMF's spring
//              with current_loop Kp = L w_c,           Ki = R(n) w_c, but not where the reference is at its lower bound
//
// R(n) is the line resistance plus the commutation drop 3/pi*omega_e*L, t_d the delay of the speed, a mean over an
// electrical turn: w_b shrinks where that is long. The measured speed is compared with the ramp as it was t_d ago; what the
// ramp has gone since then is added to the speed that the EMF follows from. The ramp is no steeper than the current allows, and
// goes at most 1/8 of the speed in a sector upward, 1/4 downward.
// Firm: with sync_rect and correction B the voltage follows the ramp alone and the EMF line holds the rotor. There the
// rotor is expected behind the ramp by the lag of the current, and the measured speed is compared with that, as it was t_d
// ago. The ramp ends as the current can fall, and each pair has its own EMF (control/pair_emf.h). The EMF of sinusoidal
// phases is followed within the sector. The trim compares the current with i_ref behind that lag. Below the boundary of
// continuous conduction the pulse follows from i_ref alone (control/boundary.h).
#ifndef FL_REGULATE_H
#define FL_REGULATE_H

#include "control/boundary.h"
#include "control/csc_linearity.h"
#include "control/limiter.h"
#include "control/pair_emf.h"
#include "control/pi.h"
#include "control/ramp.h"
#include "drive/six_step/pwm.h"
#include "drive/six_step/view.h"

#define REGULATE_PREPARE_TICKS 8u

// The voltage can brake and follows the ramp alone.
static inline bool is_firm(const settings_t *settings) {
  return settings->sync_rect && !settings->current_loop && settings->balance != BALANCE_NONE;
}

// Gains and limits of the speed control that vary with speed and DC-link voltage.
typedef struct {
  pi_gains_t speed;      // rpm_q8 -> i_q25
  pi_gains_t current;    // i_q25 -> v_q25
  pi_gains_t trim;       // the same while the reference is at its lower bound
  gain_t resistance;     // R(n), i_q25 -> v_q25
  int32_t scale_q16;     // reduction of the bandwidths at low speed
  int32_t lag_q16;       // a tick over the delay of the measured speed
  int32_t low_v_q25;     // of the least and of the largest duty
  int32_t high_v_q25;
  int32_t line_ratio_q16;   // current of the conducting pair over DC-link current
  int32_t limit_i_q25;      // the lower one of current limit and DC limit
  int32_t resistive_v_q25;  // R * current limit
  int32_t acceleration_i_q25;
  int32_t sector_rpm_q20;  // most that the ramp goes up in a tick, for a sector of now
  int32_t noise_i_q25;  // how far below its bound the reference may swing unseen
  boundary_t boundary;  // of the carrier that the settings ask for
  int32_t dead_steep;   // of what dead times take, over the current
  int32_t flux_q12;     // the EMF over that of the file, less 1
  int32_t least_i_q25;  // of the shortest pulse in the longest carrier, where diodes end it
  csc_linearity_t linearity;
  int32_t advance_q16;  // what speed and current add
} scheduled_t;

// What gives the current while running.
typedef enum { REGULATOR_SPEED, REGULATOR_TORQUE } regulator_t;

typedef struct {
  scheduled_t scheduled;
  ramp_t ramp;
  uint32_t schedule_group;  // due next
  bool schedule_skipped;
  regulator_t regulator;
  bool linear;  // settings->linearity that the gains were set for
  bool was_frozen;
  bool rectifies;  // synchronously
  limit_t limit;
  pi_state_t speed_pi;
  pi_state_t current_pi;
  int32_t reference_i_q25;
  pair_emf_t pair_emf;
  int32_t expected_i_q25;  // the reference behind the filter of the measured current
  int32_t flowing_i_q25;   // the same behind the lag of the current
  int32_t counted_i_q25;   // what dead times are counted for
  int32_t saturated;  // the current regulator's voltage was at its upper limit: 1, at its lower one: -1
  limiter_t limiter;
  int32_t rotor_rpm_q8;   // the ramp behind the lag of the current
  int32_t lagged_rpm_q8;  // the same as the measured speed shows it
  int32_t crossed_rpm_q8[SHORT_INTERVALS];  // the ramp at the last crossings, the last one first
  bool at_least;  // the reference is at its lower bound
  int32_t brake_i_q25;  // largest braking current now
  int32_t advance_q16;
} regulate_t;

// What the regulators are told, besides the view.
typedef struct {
  bool reverse;
  bool busy;                // a tick that has other work leaves the schedule to another one
  uint32_t longest_cycles;  // carrier period that still gives enough pulses in a sector
  uint32_t period_cycles;   // of the carrier
  bool restarts;            // commutations restart it
} regulate_input_t;

void regulate_init(regulate_t *r, const settings_t *settings);

// Schedule gains, one group a tick: for at least REGULATE_PREPARE_TICKS before regulate_begin.
void regulate_prepare(regulate_t *r, const pwm_t *pwm, const six_step_view_t *view, const regulate_input_t *in,
                      uint32_t ticks);

// Go on from the voltage of now.
void regulate_begin(regulate_t *r, pwm_t *pwm, const six_step_view_t *view, const regulate_input_t *in);

// After it: what flows accelerates the rotor of a start, none of it is for a load.
void regulate_unload(regulate_t *r);

// One step toward a target (magnitude). About 950 clocks with what it calls.
void regulate_step(regulate_t *r, pwm_t *pwm, const six_step_view_t *view, const regulate_input_t *in,
                   int32_t target_rpm_q8);

// While frozen: nothing moves.
void regulate_freeze(regulate_t *r);

// The target has the other sign.
bool regulate_turns_wrong(const settings_t *settings, bool reverse);

// Slow enough to open the gates of a drive that is to stop: about the stop speed, or where the least duty holds a
// braked rotor above it.
bool regulate_nearly_stopped(const regulate_t *r, const six_step_view_t *view);

#endif
