// SPDX-FileCopyrightText: 2026 Fluxlock contributors
// SPDX-License-Identifier: Apache-2.0

// From the wanted mean voltage to duty, carrier period and pulse width.
//
// Duty. While the pulse is off the current freewheels through one diode (drop V_D, 0 with synchronous
// rectification): u = d*Vdc - (1 - d)*V_D, so d = (u + V_D) / (Vdc + V_D).
// Carrier. A crossing needs samples that have settled inside a pulse: where the wanted carrier makes pulses
// shorter than on_time_floor the carrier is made longer, up to the period used at start.
// Width. With synchronous rectification both switches turn on later by the dead time, and a diode conducts meanwhile: the
// lower one for a current that drives, so that the pulse is added a dead time, the upper one for a current that brakes.
#ifndef FL_CARRIER_H
#define FL_CARRIER_H

#include <stdint.h>

// Duty for a mean voltage, limited to 0..1, 22 bits. |u| <= 2 * PRODUCT_MAX, 0 <= vdc, diode <= 2^25. About 110 clocks.
int32_t duty_from_voltage_q30(int32_t u_v_q25, int32_t vdc_v_q25, int32_t diode_v_q25);

// The voltage that a duty gives: inverse of duty_from_voltage_q30.
int32_t voltage_from_duty_v_q25(int32_t duty_q30, int32_t vdc_v_q25, int32_t diode_v_q25);

// Carrier period for a duty; period_cycles <= longest_cycles, floor below 2^16. About 70 clocks.
uint32_t carrier_period_cycles(int32_t duty_q30, uint32_t period_cycles, uint32_t longest_cycles,
                               uint32_t on_time_floor_cycles);

// Pulse width in Q16.8 clocks with what is added to it, within 24 bits; a duty of 0 has no pulse.
uint32_t pulse_cycles_q8(int32_t duty_q30, uint32_t period_cycles, int32_t added_cycles_q8);

#endif
