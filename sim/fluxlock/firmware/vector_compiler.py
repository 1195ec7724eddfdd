# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Parameters of the vector drive from machine, inverter and drive. Equations: docs/theory/vector.md.

Symbols: V, I full scales of voltage and current, psi fundamental phase flux (peak), R phase and switch, L mean of the
axes, p pole pairs, J inertia; T_s sample period of the regulators, T control tick, w electrical speed.
"""

from __future__ import annotations

import math
from typing import get_args

import numpy as np

from fluxlock.clock import CLOCK_HZ
from fluxlock.config.injection_rules import injection_loops
from fluxlock.config.machine import Machine
from fluxlock.config.motor import OVERSPEED_RATIO, RPM_PER_RAD_S
from fluxlock.config.vector import InversePark, Regulator, Vector
from fluxlock.config.vector_design import (
    ENCODER_QUARTERS_MIN,
    WEAKENING_CURRENT_SHARE,
    circle,
    dead_time_cycles,
    handover_rpm,
    linear_voltage,
    margin_cycles,
    regulator_damping,
    start_accel_rpm_per_s,
    start_current_a,
    told_lines,
)
from fluxlock.config.vector_loops import RIPPLE_RATIO, loops_of, plant_of, swings_by_dead_time
from fluxlock.config.vector_modes import KI_DIVISOR, PLL_BANDWIDTH, loop_gains
from fluxlock.config.vector_timing import VectorTiming
from fluxlock.firmware.block import Value, gain
from fluxlock.firmware.design import BRAKE_MARGIN, Q8, Q16, Q17, Q20, Q24, Q25, Q30, Q32, Q36, Q44, Q60, Design
from fluxlock.firmware.injection_compiler import injection_parameters

PI_INTEGRAL = 2.0**5  # fraction bits of an integral below its output (sw/control/pi.h)

BACK_SHARE = 0.6  # way back to the forced frame, over the hand-over's speed
EMF_SHARE = 0.5  # EMF that counts, over that of the way back
# The rotor swings about the forced current like a pendulum. Alignment in its periods; the hand-over takes a swing that
# for a tenth of a period or more leads no further than the same time at most does of one with an amplitude of 0.15 rad.
ALIGN_PERIODS = 2.0
ALIGN_S = (0.02, 1.0)
STEADY_AMPLITUDE_RAD = 0.15
STEADY_PERIODS = 0.1
STEADY_TICKS_MIN = 20
CURRENT_RISE_S = 0.02
# Of that swing: twice the share of the damping that lets it creep; low pass of what damps it, over its frequency.
DAMPING = 1.4
SMOOTH_RATIO = 4.0
APPROACH_SHARE = 0.5  # bandwidth of the ramp before its end, over the speed regulator's
SPEED_LIMIT_RATIO = 1.2  # of the estimate, over the over-speed limit
TURN_A_TICK_MAX = 0.45
BRAKE_APPROACH_S = 2e-3  # in which the link nears the voltage at which nothing is fed back
WEAKENING_HZ = 20.0
# What the check of the angle takes for wrong: share of the resistance, and of a dead time that is compensated.
RESISTANCE_LEFT = 0.5
DEAD_TIME_LEFT = 0.25
RATIO_FULL_SCALES = 32.0  # largest psi / (L_q - L_d); beyond it the machine counts as not salient
# Current over which the dead-time compensation grows to the whole beyond its band: of the largest band V_dc T / (12 L).
DEAD_TIME_ZONE_SHARE = 0.25
# The same with the currents at the edges themselves, as injection has them: docs/theory/five-phase.md, Dead time.
EDGE_ZONE_SHARE = 0.075
DEAD_TIME_LSB = 8.0
# Of the table of the EMF's shape, which holds the harmonics 6 n +- 1 below a number.
SHAPE_POINTS, SHAPE_HARMONICS = 9, 1000
# Share of the shortest quarter of a line that the encoder's filter takes.
ENCODER_FILTER_SHARE = 0.25
ENCODER_FILTER_MAX = 50


def ripple_a_per_v(machine: Machine, timing: VectorTiming) -> float:
    """Carrier ripple of a phase's current at its leg's edges, where its voltage is zero, over the phase voltage (A/V).

    Half of the peak to peak value, single or double update; docs/theory/vector.md, Dead time. While the current is
    smaller its sign at the edges is such that the dead time costs nothing.
    """
    return timing.carrier_cycles / CLOCK_HZ / (4.0 * math.sqrt(3.0) * machine.inductance_h)


def _gains(**factors: float) -> dict[str, Value]:
    """Parameters that are real factors."""
    return {name: gain(factor, name) for name, factor in factors.items()}


def _pll(vector: Vector, timing: VectorTiming, pll_hz: float) -> dict[str, Value]:
    """Loop with all poles at p = exp(-omega_n T) (sw/control/pll.h); its input is the sine, q30 = 1."""
    tick_s = timing.tick_cycles / CLOCK_HZ
    omega_n = 2 * math.pi * pll_hz / PLL_BANDWIDTH[vector.pll_order]
    angle, speed, slope = loop_gains(vector.pll_order, omega_n, tick_s)
    turn_q30 = 2.0 * math.pi * Q30
    return _gains(
        vector_pll_angle=angle * Q32 / turn_q30,
        vector_pll_speed=speed * tick_s * Q60 / turn_q30 / timing.tick_cycles,
        vector_pll_acceleration=slope * tick_s**2 * Q60 / turn_q30 / timing.tick_cycles,
    )


def _has_encoder(d: Design) -> bool:
    """Whether the drive has one that is fine enough."""
    return told_lines(d.s) * 4 >= ENCODER_QUARTERS_MIN * d.s.motor.pole_pairs


def _start(d: Design) -> dict[str, Value]:
    """I/f start and hand-over (sw/control/if_start.h)."""
    m, motor, tick_s, p = d.machine, d.s.motor, d.tick_s, d.s.motor.pole_pairs
    current = start_current_a(d.s)
    per_tick = max(1, round(current * d.ampere * tick_s / CURRENT_RISE_S))
    # Stiffness p T_max of the angle over J: J d2(theta)/dt2 = -3/2 p^2 psi I theta.
    pendulum = math.sqrt(p * m.torque_nm_per_a * current / motor.inertia_kgm2)
    period_s = 2.0 * math.pi / pendulum
    align_ticks = max(1, round(min(max(ALIGN_PERIODS * period_s, ALIGN_S[0]), ALIGN_S[1]) / tick_s))
    accel = start_accel_rpm_per_s(d.s) / 60.0 * p  # turn/s^2
    over = handover_rpm(d.s) / 60.0 * p  # turn/s
    # i_q of k (psi omega_rotor) damps by K_t k psi omega_rotor; beyond 1 / R an R told too large would feed itself.
    creeping_a_per_v = DAMPING * pendulum * motor.inertia_kgm2 / (p * m.torque_nm_per_a * m.fundamental_vs)
    damping_a_per_v = min(creeping_a_per_v, 1.0 / m.resistance_ohm)
    encoder = _has_encoder(d)
    steady_ticks = max(STEADY_TICKS_MIN, round(STEADY_PERIODS * period_s / tick_s))
    half_swing = math.pi * min(steady_ticks * tick_s / period_s, 0.5)  # of the steady time
    emf_v = EMF_SHARE * BACK_SHARE * 2 * math.pi * over * m.fundamental_vs
    return {
        "vector_start_i_q25": max(1, round(current * d.ampere)),
        "vector_start_rise_i_q25": per_tick,
        "vector_start_align_ticks": align_ticks,
        "vector_start_turned_ticks": 0 if encoder else align_ticks // 2,
        "vector_start_accel_turn_q44": max(1, round(accel * tick_s / CLOCK_HZ * Q44)),
        **_gains(vector_start_damping=0.0 if encoder else damping_a_per_v * d.ampere / d.volt),
        "vector_start_smooth_q16": max(1, round(-math.expm1(-SMOOTH_RATIO * pendulum * tick_s) * Q16)),
        "vector_start_tolerance_q32": round(STEADY_AMPLITUDE_RAD / math.pi * math.sin(half_swing) * Q32),
        "vector_start_steady_ticks": steady_ticks,
        "vector_handover_turn_q36": max(1, round(over / CLOCK_HZ * Q36)),
        "vector_back_turn_q36": max(1, round(BACK_SHARE * over / CLOCK_HZ * Q36)),
        "vector_fade_i_q25": per_tick,
        "vector_emf_minimum_v_q25": max(1, round(emf_v * d.volt)),
    }


def _weakening(d: Design) -> dict[str, Value]:
    """Field weakening and split of the torque current. At the highest speed d|u| / d i_d is about omega L."""
    m, on = d.machine, d.s.drive.vector.weakening
    ki = 2 * math.pi * WEAKENING_HZ * d.tick_s / (m.omega_max * m.inductance_h)
    lowest = min(WEAKENING_CURRENT_SHARE * d.s.current_limit_a, m.fundamental_vs / m.inductance_h)
    ratio = m.fundamental_vs / m.saliency_h * d.ampere if m.saliency_h else 0.0
    return {
        **_gains(vector_weakening_ki=ki * PI_INTEGRAL * d.ampere / d.volt if on else 0.0),
        "vector_weakening_lowest_i_q25": -round(lowest * d.ampere) if on else 0,
        "vector_mtpa_ratio_i_q25": round(ratio) if abs(ratio) <= RATIO_FULL_SCALES * Q25 else 0,
    }


def _encoder(d: Design) -> dict[str, Value]:
    """Encoder (sw/control/encoder.h)."""
    vector, motor, encoder = d.s.drive.vector, d.s.motor, d.s.motor.encoder
    quarters = 4 * told_lines(d.s)
    if encoder is None or not _has_encoder(d):
        return {
            "vector_angle": 0,
            "encoder_quarters": 1,
            "encoder_index": 0,
            "encoder_filter_cycles": 1,
            "encoder_offset_q32": 0,
            **_gains(encoder_turn=0.0),
        }
    shortest = CLOCK_HZ / (quarters * OVERSPEED_RATIO * motor.max_speed_rpm / 60.0)
    offset = motor.pole_pairs * (encoder.offset_deg + d.s.drive.motor_error.encoder_offset_deg) / 360.0
    return {
        "vector_angle": int(vector.angle == "encoder"),
        "encoder_quarters": quarters,
        "encoder_index": int(encoder.index and vector.mounting == "given"),
        "encoder_filter_cycles": min(max(int(ENCODER_FILTER_SHARE * shortest), 1), ENCODER_FILTER_MAX),
        "encoder_offset_q32": round(((offset + 0.5) % 1.0 - 0.5) * Q32 * (1.0 - 2.0**-40)),
        **_gains(encoder_turn=motor.pole_pairs / (2 * quarters) * Q32),
    }


def _modulator(d: Design, timing: VectorTiming) -> dict[str, Value]:
    """Scale, dead time and margins (rtl/foc/fl_modulator.sv)."""
    inverter, vector, amp_q17 = d.s.inverter, d.s.drive.vector, d.ampere / Q8
    lost = dead_time_cycles(inverter) if vector.dead_time_compensation else 0
    ripple = ripple_a_per_v(d.machine, timing)
    zone_a = max(
        (EDGE_ZONE_SHARE if vector.injection else DEAD_TIME_ZONE_SHARE) * ripple * inverter.supply_v / math.sqrt(3.0),
        DEAD_TIME_LSB * inverter.sensing.current_full_scale_a / 2.0**inverter.sensing.bits,
    )
    band = ripple * amp_q17 * (inverter.sensing.voltage_full_scale_v / Q25)
    slope = lost / (zone_a * Q17 / inverter.sensing.current_full_scale_a)
    shift = 0
    while 0 < slope * 2 ** (shift + 1) < Q17 - 1 and shift < 31:
        shift += 1
    return {
        "vector_circle_q16": round(circle(inverter, timing) * linear_voltage(d.s.motor.phases) * math.sqrt(3.0) * Q16),
        # Clocks a unit of v_q17 are N V / vdc 2^-17; vdc counts in v_q25.
        **_gains(vector_scale_v=timing.carrier_cycles * Q8, vector_band=band),
        "vector_slope": min(round(slope * 2**shift), Q17 - 1),
        "vector_slope_shift": shift,
        "vector_dead_comp_cycles": lost,
        "vector_margin_cycles": margin_cycles(inverter),
    }


def _timing(vector: Vector, timing: VectorTiming) -> dict[str, Value]:
    """Clocks of updates and samples."""
    return {
        "method": 1,
        "tick_cycles": timing.tick_cycles,
        "sample_mode": 2,
        "sample_offset_cycles": timing.offset_cycles,
        "vector_double": int(vector.update == "double"),
        "vector_direct": int(vector.current_regulator == "c"),
        "vector_sample_cycles": timing.sample_cycles,
        "vector_tick_samples": timing.tick_samples,
        "vector_from_cycles": timing.from_cycles,
        "vector_length_cycles": timing.length_cycles,
    }


def _regulator(d: Design, timing: VectorTiming) -> dict[str, Value]:
    """Current regulator, EMF observer and inverse Park transform: the machine from sample to sample."""
    m, vector, sample_s = d.machine, d.s.drive.vector, timing.sample_cycles / CLOCK_HZ
    sensing = d.s.inverter.sensing
    delay = timing.delay if vector.believed_delay is None else vector.believed_delay
    # T_s V / (L I): current from voltage, both in parts of their full scale.
    admittance = sample_s * sensing.voltage_full_scale_v / (m.inductance_h * sensing.current_full_scale_a)
    # Of a salient machine L_d opposes a change of the current, L_q turns with the frame: what is left stands on the q
    # axis then, at any change of the current.
    half = m.saliency_h / 2.0 / m.inductance_h
    observed, cross = (1.0 + half, 0.0) if vector.injection else (1.0 - half, 2.0 * half / (1.0 - half))
    return {
        "vector_resistance_q30": round(m.resistance_ohm / m.inductance_h * sample_s * Q30),
        "vector_observer_resistance_q30": round(m.resistance_ohm / (m.inductance_h * observed) * sample_s * Q30),
        "vector_delay_q30": round(min(delay, 1.0) * Q30),
        "vector_park": get_args(InversePark).index(vector.park),
        "vector_order": get_args(Regulator).index(vector.regulator),
        "vector_bandwidth_q30": round(2.0 * math.pi * vector.bandwidth_hz * sample_s * Q30),
        "vector_gamma_q30": round((injection_loops(d.s).gamma if vector.injection else vector.gamma) * Q30),
        "vector_damping_q30": round(regulator_damping(m, vector, sample_s) * Q30),
        "vector_pole1_q30": round(vector.observer_pole * Q30),
        "vector_pole2_q30": round(vector.observer_pole * Q30),
        **_gains(
            vector_admittance=admittance,
            vector_impedance=1.0 / admittance,
            vector_observer_admittance=admittance / observed,
            vector_observer_impedance=observed / admittance,
        ),
        "vector_cross_q16": round(cross * Q16),
    }


def lost_floor_v(d: Design, timing: VectorTiming) -> float:
    """Voltage that the observer may be wrong by without a current (V): dead time, six times the noise of its EMF.

    The noise passes (z - 1) / (z - p)^2, whose response has the square sum 2 / ((1 + p)^3 (1 - p)).
    """
    inverter, vector = d.s.inverter, d.s.drive.vector
    sensing, pole = inverter.sensing, vector.observer_pole
    share = DEAD_TIME_LEFT if vector.dead_time_compensation else 1.0
    dead_v = 4.0 / math.pi * inverter.supply_v * inverter.dead_time_s * CLOCK_HZ / timing.carrier_cycles
    step_a = 2.0 * sensing.current_full_scale_a / 2.0**sensing.bits
    noise_a = step_a * math.sqrt(2.0 / 3.0 * (sensing.noise_lsb**2 + 1.0 / 12.0))
    response = (1.0 - pole) ** 2 * math.sqrt(2.0 / ((1.0 + pole) ** 3 * (1.0 - pole)))
    return share * dead_v + 6.0 * response * d.machine.inductance_h / d.tick_s * noise_a


def _lost(d: Design, timing: VectorTiming) -> dict[str, Value]:
    """What may be wrong about the observed EMF (sw/control/lost_angle.h)."""
    return {
        "vector_lost_floor_v_q25": max(1, round(lost_floor_v(d, timing) * d.volt)),
        **_gains(vector_lost_resistance=RESISTANCE_LEFT * d.machine.resistance_ohm * d.volt / d.ampere),
    }


def _brake_power(d: Design) -> int:
    """Braking current times speed at which a link that nobody discharges nears its bound in BRAKE_APPROACH_S.

    The bound's taper is a gain from the link's voltage to the current: C v dv/dt = m/2 psi w i.
    """
    inverter, m = d.s.inverter, d.machine
    if not inverter.supply_diode or inverter.brake_chopper is not None:
        return 0
    taper_v = (BRAKE_MARGIN[1] - BRAKE_MARGIN[0]) * (inverter.over_voltage_v - inverter.supply_v)
    watts = inverter.dc_link_f * inverter.supply_v * taper_v / BRAKE_APPROACH_S
    ampere_rad_s = watts / (d.s.motor.phases / 2 * m.fundamental_vs)
    return min(max(1, round(ampere_rad_s * d.ampere / Q8 * Q36 / CLOCK_HZ / (2 * math.pi) / Q8)), 2**31 - 1)


def _harmonics(d: Design, speed_hz: float) -> int:
    """RIPPLE_* of sw/control/ripple.h."""
    if d.s.motor.emf == "trapezoidal":
        return 3
    return 2 if swings_by_dead_time(plant_of(d.s), speed_hz) else 1


def _shape(d: Design, timing: VectorTiming) -> dict[str, Value]:
    """Harmonics of the EMF in the rotor's frame (sw/control/emf_shape.h); injection sends a voltage of its own."""
    motor = d.s.motor
    shaped = motor.emf != "sinusoidal" and motor.phases == 3 and d.s.drive.vector.injection is None
    six_theta = np.linspace(0.0, math.pi, SHAPE_POINTS)
    d_parts, q_parts = np.zeros(SHAPE_POINTS), np.zeros(SHAPE_POINTS)
    for n in range(6, SHAPE_HARMONICS, 6):
        before, after = motor.emf_harmonic(n - 1), motor.emf_harmonic(n + 1)
        d_parts -= (before + after) * np.sin(n / 6 * six_theta)
        q_parts += (after - before) * np.cos(n / 6 * six_theta)
    # A set is taken a tick later. It acts with the samples after that one, up to the next one that is taken.
    samples = 1.5 * timing.tick_cycles / timing.sample_cycles + 1.0 + timing.delay
    return {
        "vector_shape_d_q24": tuple(round(float(x) * Q24) for x in d_parts),
        "vector_shape_q_q24": tuple(round(float(x) * Q24) for x in q_parts),
        "vector_shape_lead_cycles": round(samples * timing.sample_cycles),
        "vector_shape_most_turn_q36": round(Q36 / 24 / timing.tick_cycles) if shaped else 0,
    }


def _speed(d: Design, speed_hz: float, pll_hz: float) -> dict[str, Value]:
    """J/p domega/dt = T: k_p closes the speed loop at its bandwidth."""
    m, motor, p, tick_s = d.machine, d.s.motor, d.s.motor.pole_pairs, d.tick_s
    unit_rad_s = 2.0 * math.pi * CLOCK_HZ / Q36  # of a speed of 2^-36 turn a clock
    speed_rad = 2.0 * math.pi * speed_hz
    speed_kp = speed_rad * motor.inertia_kgm2 / (p * m.torque_nm_per_a) * unit_rad_s * d.ampere
    # The whole change of the current, from one limit to the other.
    window_rad_s = 2.0 * d.s.current_limit_a * m.torque_nm_per_a * p / motor.inertia_kgm2 / speed_rad
    most_turns = min(SPEED_LIMIT_RATIO * OVERSPEED_RATIO * m.omega_max / (2 * math.pi), TURN_A_TICK_MAX / tick_s)
    return {
        "vector_brake_power": _brake_power(d),
        "ramp_window_rpm": max(1, round(window_rad_s / p * RPM_PER_RAD_S)),
        "vector_speed_max_turn_q36": round(most_turns / CLOCK_HZ * Q36),
        "vector_whole_turn_q36": max(1, round(RIPPLE_RATIO * speed_hz / 2.0 / CLOCK_HZ * Q36)),
        "vector_ripple_most_turn_q36": round(pll_hz / 2.0 / CLOCK_HZ * Q36),
        "vector_harmonics": _harmonics(d, speed_hz),
        **_gains(
            vector_speed_kp=speed_kp,
            vector_speed_ki=speed_kp * speed_rad / KI_DIVISOR * tick_s * PI_INTEGRAL,
            vector_approach=APPROACH_SHARE * speed_rad * tick_s * Q20 / Q8,
            vector_soft=Q8 / (APPROACH_SHARE * speed_rad * tick_s * Q20),
            vector_speed_scale=2.0 * CLOCK_HZ / Q36 / (RIPPLE_RATIO * speed_hz) * Q16,
            vector_accel=motor.inertia_kgm2 / m.torque_nm_per_a / RPM_PER_RAD_S / Q20 / tick_s * d.ampere,
            vector_rpm_to_turn=p / 60.0 / Q8 / CLOCK_HZ * Q36,
            vector_flux=m.fundamental_vs * unit_rad_s * d.volt,
        ),
    }


def vector_parameters(d: Design) -> dict[str, Value]:
    """All parameters that only the vector drive has, and those that it has otherwise than six-step operation.

    Values that do not fit raise ParameterError when the block is packed.
    """
    vector, timing = d.s.drive.vector, d.timing
    assert timing is not None
    bandwidths = loops_of(d.s)
    return {
        **_timing(vector, timing),
        **_regulator(d, timing),
        **_speed(d, bandwidths.speed_hz, bandwidths.pll_hz),
        **_shape(d, timing),
        **_pll(vector, timing, bandwidths.pll_hz),
        **_lost(d, timing),
        **_start(d),
        **_weakening(d),
        **_encoder(d),
        **_modulator(d, timing),
        **injection_parameters(d, timing),
    }
