// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// Shared by the parts of the vector drive. One file writes a field of vector_t or of the report, the others tell it:
//
//   vector.c    control step: limits, speed regulator, field weakening, supervision, the current's reference
//   frame.c     frames and the ways between them: which one, phase and gates, the forced start, the encoder's mounting
//   observed.c  EMF observer and loop; the frame's speed and turn
//   design.c    constants and gains; what they are for, and what is shown with them
//   injected.c  vector_injection_t
//   current.c   the command
#ifndef FL_VECTOR_PARTS_H
#define FL_VECTOR_PARTS_H

#include "control/complex_fixed.h"
#include "control/fixed.h"
#include "control/trig.h"
#include "drive/vector/vector.h"

enum { GROUP_SPEED, GROUP_FIELD, GROUP_LIMITS, GROUP_SUPERVISION };

// The estimate is lost where the error stays beyond 30 degrees.
#define LOST_ERROR_Q30 (ONE_Q30 / 2)

static inline int32_t rpm_q8(const vector_t *v, int32_t speed_turn_q36) {
  return gain_apply(speed_turn_q36, v->to_rpm);
}

// What others are told of the speed.
static inline void tell_speed(vector_t *v, int32_t speed_rpm_q8, bool known) {
  v->report.speed_rpm_q8 = known ? speed_rpm_q8 : 0;
  v->report.speed_unknown = !known;
}

static inline complex_t to_q17(complex_t z_q25) {
  return (complex_t){(z_q25.re + 128) >> 8, (z_q25.im + 128) >> 8};
}

// exp(-j turn): takes vectors into a frame that is ahead by `turn`.
static inline complex_t rotation_q30(int32_t turn_q32) { return cis_q30(0u - (uint32_t)turn_q32); }

// Length within 7 per cent.
static inline uint32_t rough_length(complex_t z) {
  const uint32_t a = (uint32_t)abs_sat(z.re);
  const uint32_t b = (uint32_t)abs_sat(z.im);
  return (a > b) ? a + (b >> 1) - (b >> 3) : b + (a >> 1) - (a >> 3);
}

static inline bool vector_injects(const vector_t *v) { return (HELD & HELD_INJECTION) != 0 && v->injection != 0; }
static inline bool vector_frame_is_injected(const vector_t *v) {
  return (HELD & HELD_INJECTION) != 0 && v->frame == FRAME_INJECTED;
}

// The search applies its two waves: the phase currents tell whether there is an open one.
static inline bool vector_open_phase_listens(const vector_t *v) {
  return v->injection->frame.resting && v->injection->frame.rest.phase < REST_LOCK;
}

// Electrical angle of the rotor by the encoder.
static inline uint32_t encoder_angle_q32(const vector_t *v) { return v->encoder_turn_q32 + v->encoder_offset_q32; }

// The machine of one sample.
vector_machine_t vector_machine(const parameters_t *p);

// Constants from the parameters; then the gains for standstill.
void vector_constants(vector_t *v);
void vector_first_design(vector_t *v);

// Current of the forced frame: 1.4 times as much after each attempt that has failed, up to three quarters of the limit.
void vector_start_current(vector_t *v);

// Subspace 1 as its regulators are to know it now.
const vector_plant_t *vector_present_plant(const vector_t *v);

// 1 / count, kept.
int32_t vector_share_of(share_t *share, uint32_t count);

// A coasting rotor turns by mean_step_q32 a tick, the EMF at angle_q32 now: the frame goes along with it, the gates follow
// when the regulator's voltage is the EMF. With the encoder its angle counts, which the EMF has to confirm; one that has not
// seen its index gets its mounting from the EMF. Slower than the hand-over nothing happens.
outcome_t vector_catch(vector_t *v, uint32_t angle_q32, int32_t mean_step_q32, bool indexed);

// Encoder (sensored.c). Angle of the rotor without the offset, which an index sets.
void vector_read_encoder(vector_t *v, const chip_vector_snapshot_t *in);

// A tick of the alignment; its end, at which the mounting is learnt where no index has told it.
void vector_watch_alignment(vector_t *v);
void vector_learn_mounting(vector_t *v, const chip_vector_snapshot_t *in);

// Does the encoder leave the swing of the alignment with the frame that leads the rotor on? Half a turn without it: a load or
// friction may hold the rotor. Does it go along with a coasting rotor, and does its index show that one's angle? Without an
// index it gets its mounting from there.
typedef enum { ENCODER_UNPROVEN, ENCODER_RIGHT, ENCODER_WRONG } encoder_proof_t;
encoder_proof_t vector_prove_encoder(const vector_t *v);
encoder_proof_t vector_prove_coasting(vector_t *v, uint32_t rotor_turn_q32, bool indexed);

// The encoder beside the frame, steps that it lost.
void vector_compare_encoder(vector_t *v, const chip_vector_snapshot_t *in);

// Does the machine agree with the encoder that the frame follows? A drive that begins anew judges anew.
outcome_t vector_judge_encoder(vector_t *v, uint32_t expected_v_q25, const chip_vector_snapshot_t *in);
void vector_doubt_encoder(vector_t *v);

// The rotor is slow enough after the coast: switch on and align; after an over-current look at the insulation before.
outcome_t vector_begin(vector_t *v);

// Speed of the frame from the next tick on; a turn of it besides, with the regulator held at its preset for a tick or not.
void vector_lead(vector_t *v, int32_t speed_turn_q36);
void vector_turn(vector_t *v, int32_t turn_q32, bool hold);

// Observer, and the loop with the frame's speed and its change a tick, begin where the rotor is known otherwise.
void vector_observe_from(vector_t *v, complex_t current_i_q17, complex_t emf_v_q25);
void vector_track_from(vector_t *v, int32_t change_q32);

// Error of the frame's angle by the EMF; not seen: 0. Then one step of the loop, which turns the frame.
void vector_emf_error(vector_t *v, bool seen);
void vector_track(vector_t *v, bool taken);

// Length of the observed EMF within 7 per cent, which is shown too.
uint32_t vector_emf_amplitude(vector_t *v);

// The rotor coasts before a start.
void vector_frame_coast(vector_t *v);

// Gates, regulator and frame off.
void vector_frame_off(vector_t *v);

// One sample of the EMF observer, then the turn of the set that the chip has taken: returns it.
int32_t vector_observe(vector_t *v, const chip_vector_snapshot_t *in);
// The same, of a drive with injection.
void vector_observe_injected(vector_t *v, const chip_vector_snapshot_t *in);

// The design that waits, to the chip.
void vector_take_design(vector_t *v);
// True: one waits. One for another plant than the present one is dropped.
bool vector_design_meant(vector_t *v);
// State of the regulator, at the look of the supervision: what the designs' bands, and the voltage that is shown, are for.
void vector_design_state(vector_t *v, complex_t voltage_v_q25);
// The frame is turned: so is the voltage that the dead time's compensation adds.
void vector_design_turn(vector_t *v, complex_t rotation_q30);
// Nothing flows.
void vector_design_off(vector_t *v);

// A caught rotor: from the frame that goes along to the gates. At rest: the check of the insulation.
outcome_t vector_caught_step(vector_t *v, const chip_snapshot_t *in);

// One step with the forced frame, to the hand-over, and the reference of the current.
outcome_t vector_forced_step(vector_t *v, const chip_snapshot_t *in, complex_t *reference_i_q25);

// From the observed frame to the forced one: the reference of the current there.
complex_t vector_hand_back(vector_t *v, const chip_snapshot_t *in);

#endif
