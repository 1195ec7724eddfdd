// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// What the vector path is told: the only writer of its command. Everything acts at the next tick.
#ifndef FL_VECTOR_CURRENT_H
#define FL_VECTOR_CURRENT_H

#include "control/complex_regulator.h"
#include "control/fixed.h"
#include "hal/chip_io.h"

// Legs on; off with the regulator of subspace 1 at no voltage.
void current_on(vector_command_t *c);
void current_off(vector_command_t *c);

// State of a subspace's regulator while it does not regulate.
void current_preset(vector_command_t *c, uint32_t subspace, complex_t voltage_v_q25);

// Gains of a subspace; then the band without dead-time compensation, with which they are sent.
void current_gains(vector_command_t *c, uint32_t subspace, const regulator_gains_t *gains);
void current_band(vector_command_t *c, uint32_t band_i_q17);

// Voltage circles of the subspaces, lead, and the modulator's scale = mant 2^-shift / vdc.
void current_limits(vector_command_t *c, uint32_t first_v_q17, uint32_t second_v_q17, int32_t lead_q32, gain_t scale_v,
                    int32_t vdc_v_q25);

// Speed and turn of the frame, reference of subspace 1, whether its regulator works; repeat: send that anyway.
void current_frame(vector_command_t *c, int32_t speed_turn_q36, int32_t turn_q32, complex_t reference_i_q17,
                   bool regulate, bool repeat);

// Subspace 2, and the forward voltage of either.
void current_second(vector_command_t *c, complex_t reference_i_q17, bool regulate);
void current_forward(vector_command_t *c, uint32_t subspace, complex_t voltage_v_q17);

// The wave: on or off, send: it changes. Its filters begin anew when it is sent next.
void current_wave(vector_command_t *c, bool inject, bool send);
void current_wave_anew(vector_command_t *c);
// Wave, forward voltages, references and regulators off.
void current_wave_off(vector_command_t *c);

// Whether each snapshot shall have the angle and the encoder's position.
void current_look_at_angle(vector_command_t *c, bool angle);

// What the next snapshot shall have; currents: with slow only.
void current_look(vector_command_t *c, bool slow, bool currents, bool steps);

// The tick follows the samples, else the time.
void current_tick(vector_command_t *c, bool by_samples);

#endif
