# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Parameters of the vector drive from machine, inverter and drive. Equations: docs/theory/vector.md.

Symbols: V, I full scales of voltage and current, psi fundamental phase flux (peak), R phase and switch, L mean of the
axes, p pole pairs, J inertia; T_s sample period of the regulators, T control tick, w electrical speed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from fluxlock.firmware.block import Value, gain
from fluxlock.firmware.injection_compiler import injection_parameters
from fluxlock.firmware.specs import (
    INVERSE_PARKS,
    OVERSPEED_RATIO,
    REGULATORS,
    DriveSpec,
    InverterSpec,
    MotorSpec,
    VectorSpec,
)
from fluxlock.firmware.vector_timing import VectorTiming, vector_timing

RPM = 60.0 / (2.0 * math.pi)  # r/min of 1 rad/s
Q8, Q16, Q17, Q25, Q30 = 2.0**8, 2.0**16, 2.0**17, 2.0**25, 2.0**30
Q32, Q36, Q44, Q60 = 2.0**32, 2.0**36, 2.0**44, 2.0**60
PI_INTEGRAL = 2.0**5  # fraction bits of an integral below its output (sw/control/pi.h)

# Share of the start current's torque with which the forced frame accelerates: the rest is the margin against load.
START_TORQUE_SHARE = 0.3
START_CURRENT_SHARE = 0.35  # of the rated current
# Hand-over: EMF over the converter's step and over the drop of the start current in R; speed over the highest.
HANDOVER_LSB = 40.0
HANDOVER_DROPS = 3.0
HANDOVER_SPEED_SHARE = 0.1
HANDOVER_SPEED_LIMIT = 0.3
BACK_SHARE = 0.6  # way back to the forced frame, over the hand-over's speed
EMF_SHARE = 0.5  # EMF that counts, over that of the way back
# The rotor swings about the forced current like a pendulum. Alignment in its periods; the hand-over takes a swing whose
# fastest change is below that of an amplitude of 0.5 rad, for a tenth of a period.
ALIGN_PERIODS = 2.0
ALIGN_S = (0.02, 1.0)
STEADY_AMPLITUDE_RAD = 0.5
STEADY_PERIODS = 0.1
STEADY_TICKS_MIN = 20
TOLERANCE_MIN_TURN = 0.5 / 360.0
CURRENT_RISE_S = 0.02
# -3 dB bandwidth over omega_n of a phase-locked loop whose poles are all at omega_n, by order.
PLL_BANDWIDTH = {2: 2.4824, 3: 3.8989}
SPEED_LIMIT_RATIO = 1.2  # of the estimate, over the over-speed limit
TURN_A_TICK_MAX = 0.45
KI_DIVISOR = 4.0
WEAKENING_HZ = 20.0
WEAKENING_SHARE = 0.95
WEAKENING_CURRENT_SHARE = 0.8
RATIO_FULL_SCALES = 32.0  # largest psi / (L_q - L_d); beyond it the machine counts as not salient
# Current over which the dead-time compensation grows to the whole beyond its band: of the largest band V_dc T / (12 L).
DEAD_TIME_ZONE_SHARE = 0.25
# The same with the currents at the edges themselves, as injection has them: docs/theory/five-phase.md, Dead time.
EDGE_ZONE_SHARE = 0.075
DEAD_TIME_LSB = 8.0
MISS_LIMIT = 2
# Share of the shortest quarter of a line that the encoder's filter takes.
ENCODER_FILTER_SHARE = 0.25
ENCODER_FILTER_MAX = 50
ENCODER_QUARTERS_MIN = 36  # an electrical turn: a coarser encoder is left aside


@dataclass(frozen=True)
class VectorMachine:
    """Derived quantities in SI units: resistance with switch, fundamental flux, torque a q ampere."""

    resistance_ohm: float
    inductance_h: float
    psi_vs: float
    torque_nm_per_a: float
    omega_max: float  # electrical

    @staticmethod
    def of(motor: MotorSpec, inverter: InverterSpec) -> VectorMachine:
        """Of a motor with the switches of an inverter."""
        psi = motor.psi_vs * motor.emf_fundamental
        return VectorMachine(
            resistance_ohm=motor.resistance_ohm + inverter.on_resistance_ohm,
            inductance_h=motor.inductance_h,
            psi_vs=psi,
            torque_nm_per_a=motor.phases / 2 * motor.pole_pairs * psi,
            omega_max=motor.pole_pairs * motor.max_speed_rpm / RPM,
        )


def start_current_a(motor: MotorSpec, drive: DriveSpec, vector: VectorSpec) -> float:
    """Amplitude of the current that aligns and pulls the rotor along (A)."""
    if vector.start_current_a is not None:
        return vector.start_current_a
    limit_a = drive.current_limit_a if drive.current_limit_a is not None else motor.rated_current_a
    return min(START_CURRENT_SHARE * motor.rated_current_a, 0.6 * limit_a)


def start_accel_rpm_per_s(motor: MotorSpec, inverter: InverterSpec, drive: DriveSpec, vector: VectorSpec) -> float:
    """Acceleration of the forced frame, mechanical (r/min/s)."""
    if vector.start_accel_rpm_per_s is not None:
        return vector.start_accel_rpm_per_s
    torque_nm = VectorMachine.of(motor, inverter).torque_nm_per_a * start_current_a(motor, drive, vector)
    return START_TORQUE_SHARE * torque_nm / motor.inertia_kgm2 * RPM


def handover_rpm(motor: MotorSpec, inverter: InverterSpec, drive: DriveSpec, vector: VectorSpec) -> float:
    """Speed of the hand-over, mechanical (r/min)."""
    if vector.handover_rpm is not None:
        return vector.handover_rpm
    m = VectorMachine.of(motor, inverter)
    drop_v = m.resistance_ohm * start_current_a(motor, drive, vector)
    least_v = max(HANDOVER_LSB * inverter.voltage_full_scale_v / 2.0**inverter.bits, HANDOVER_DROPS * drop_v)
    omega = max(least_v / m.psi_vs, HANDOVER_SPEED_SHARE * m.omega_max)
    return min(omega, HANDOVER_SPEED_LIMIT * m.omega_max) / motor.pole_pairs * RPM


def margin_cycles(clock_hz: float, inverter: InverterSpec) -> int:
    """Least time of each switch in a carrier: the shortest pulse after the dead time has been taken off."""
    return max(2, math.ceil(inverter.dead_time_s * clock_hz - 1e-6)) + max(
        1, math.ceil(inverter.min_pulse_s * clock_hz - 1e-6)
    )


def linear_voltage(phases: int) -> float:
    """Largest amplitude of the phase voltage without distortion over vdc: 1 / sqrt(3), of five phases 0.5257."""
    return 0.5 / math.cos(math.pi / (2 * phases))


def circle(clock_hz: float, inverter: InverterSpec, timing: VectorTiming) -> float:
    """Largest voltage over the linear one: what the margins leave."""
    return 1.0 - 2.0 * margin_cycles(clock_hz, inverter) / timing.carrier_cycles


def ripple_a_per_v(motor: MotorSpec, timing: VectorTiming, clock_hz: float) -> float:
    """Carrier ripple of a phase's current at its leg's edges, where its voltage is zero, over the phase voltage (A/V).

    Half of the peak to peak value, single or double update; docs/theory/vector.md, Dead time. While the current is
    smaller its sign at the edges is such that the dead time costs nothing.
    """
    return timing.carrier_cycles / clock_hz / (4.0 * math.sqrt(3.0) * motor.inductance_h)


def _gains(**factors: float) -> dict[str, Value]:
    """Parameters that are real factors."""
    return {name: gain(factor, name) for name, factor in factors.items()}


def _pll(vector: VectorSpec, timing: VectorTiming, clock_hz: float) -> dict[str, Value]:
    """Loop with all poles at p = exp(-omega_n T), q = 1 - p (sw/control/pll.h); its input is the sine, q30 = 1."""
    q = -math.expm1(-2 * math.pi * vector.pll_hz / PLL_BANDWIDTH[vector.pll_order] * timing.tick_cycles / clock_hz)
    k_p, k_i, k_a = (2 * q, q**2, 0.0) if vector.pll_order == 2 else (3 * q, 3 * q**2, q**3)
    turn_q30 = 2.0 * math.pi * Q30
    return _gains(
        vector_pll_angle=k_p * Q32 / turn_q30,
        vector_pll_speed=k_i * Q60 / turn_q30 / timing.tick_cycles,
        vector_pll_acceleration=k_a * Q60 / turn_q30 / timing.tick_cycles,
    )


def _start(
    motor: MotorSpec, inverter: InverterSpec, drive: DriveSpec, vector: VectorSpec, tick_s: float
) -> dict[str, Value]:
    """I/f start and hand-over (sw/control/if_start.h)."""
    m = VectorMachine.of(motor, inverter)
    p, clock = motor.pole_pairs, drive.clock_hz
    current = start_current_a(motor, drive, vector)
    per_tick = max(1, round(current * Q25 / inverter.current_full_scale_a * tick_s / CURRENT_RISE_S))
    # Stiffness p T_max of the angle over J: J d2(theta)/dt2 = -3/2 p^2 psi I theta.
    pendulum = math.sqrt(p * m.torque_nm_per_a * current / motor.inertia_kgm2)
    period_s = 2.0 * math.pi / pendulum
    accel = start_accel_rpm_per_s(motor, inverter, drive, vector) / 60.0 * p  # turn/s^2
    over = handover_rpm(motor, inverter, drive, vector) / 60.0 * p  # turn/s
    tolerance = STEADY_AMPLITUDE_RAD * pendulum / (2 * math.pi) * tick_s
    return {
        "vector_start_i_q25": max(1, round(current * Q25 / inverter.current_full_scale_a)),
        "vector_start_rise_i_q25": per_tick,
        "vector_start_align_ticks": max(1, round(min(max(ALIGN_PERIODS * period_s, ALIGN_S[0]), ALIGN_S[1]) / tick_s)),
        "vector_start_accel_turn_q44": max(1, round(accel * tick_s / clock * Q44)),
        "vector_start_tolerance_q32": round(min(max(tolerance, TOLERANCE_MIN_TURN), 0.25) * Q32),
        "vector_start_steady_ticks": max(STEADY_TICKS_MIN, round(STEADY_PERIODS * period_s / tick_s)),
        "vector_handover_turn_q36": max(1, round(over / clock * Q36)),
        "vector_back_turn_q36": max(1, round(BACK_SHARE * over / clock * Q36)),
        "vector_fade_i_q25": per_tick,
        "vector_emf_minimum_v_q25": max(
            1, round(EMF_SHARE * BACK_SHARE * 2 * math.pi * over * m.psi_vs * Q25 / inverter.voltage_full_scale_v)
        ),
    }


def _weakening(
    motor: MotorSpec, inverter: InverterSpec, limit_a: float, vector: VectorSpec, tick_s: float
) -> dict[str, Value]:
    """Field weakening and split of the torque current. At the highest speed d|u| / d i_d is about omega L."""
    m = VectorMachine.of(motor, inverter)
    ampere, volt = Q25 / inverter.current_full_scale_a, Q25 / inverter.voltage_full_scale_v
    ki = 2 * math.pi * WEAKENING_HZ * tick_s / (m.omega_max * m.inductance_h)
    lowest = min(WEAKENING_CURRENT_SHARE * limit_a, m.psi_vs / m.inductance_h)
    ratio = m.psi_vs / motor.saliency_h * ampere if motor.saliency_h else 0.0
    return {
        **_gains(vector_weakening_ki=ki * PI_INTEGRAL * ampere / volt if vector.weakening else 0.0),
        "vector_weakening_share_q16": round(WEAKENING_SHARE * Q16),
        "vector_weakening_lowest_i_q25": -round(lowest * ampere) if vector.weakening else 0,
        "vector_mtpa_ratio_i_q25": round(ratio) if abs(ratio) <= RATIO_FULL_SCALES * Q25 else 0,
    }


def _encoder(motor: MotorSpec, drive: DriveSpec, vector: VectorSpec) -> dict[str, Value]:
    """Encoder (sw/control/encoder.h)."""
    if motor.encoder is None or 4 * motor.encoder.lines < ENCODER_QUARTERS_MIN * motor.pole_pairs:
        return {
            "vector_angle": 0,
            "encoder_quarters": 1,
            "encoder_index": 0,
            "encoder_filter_cycles": 1,
            "encoder_offset_q32": 0,
            **_gains(encoder_turn=0.0),
        }
    quarters = 4 * motor.encoder.lines
    shortest = drive.clock_hz / (quarters * OVERSPEED_RATIO * motor.max_speed_rpm / 60.0)
    offset = motor.pole_pairs * motor.encoder.offset_deg / 360.0
    return {
        "vector_angle": int(vector.angle == "encoder"),
        "encoder_quarters": quarters,
        "encoder_index": int(motor.encoder.index and vector.mounting == "given"),
        "encoder_filter_cycles": min(max(int(ENCODER_FILTER_SHARE * shortest), 1), ENCODER_FILTER_MAX),
        "encoder_offset_q32": round(((offset + 0.5) % 1.0 - 0.5) * Q32 * (1.0 - 2.0**-40)),
        **_gains(encoder_turn=motor.pole_pairs / (2 * quarters) * Q32),
    }


def _modulator(
    motor: MotorSpec, inverter: InverterSpec, drive: DriveSpec, vector: VectorSpec, timing: VectorTiming
) -> dict[str, Value]:
    """Scale, dead time and margins (rtl/foc/fl_modulator.sv)."""
    clock = drive.clock_hz
    lost = max(2, math.ceil(inverter.dead_time_s * clock - 1e-6)) if vector.dead_time_compensation else 0
    ripple = ripple_a_per_v(motor, timing, clock)
    zone_a = max(
        (EDGE_ZONE_SHARE if vector.injection else DEAD_TIME_ZONE_SHARE) * ripple * inverter.supply_v / math.sqrt(3.0),
        DEAD_TIME_LSB * inverter.current_full_scale_a / 2.0**inverter.bits,
    )
    band = ripple * (Q17 / inverter.current_full_scale_a) * (inverter.voltage_full_scale_v / Q25)
    slope = lost / (zone_a * Q17 / inverter.current_full_scale_a)
    shift = 0
    while 0 < slope * 2 ** (shift + 1) < Q17 - 1 and shift < 31:
        shift += 1
    return {
        "vector_circle_q16": round(
            circle(clock, inverter, timing) * linear_voltage(motor.phases) * math.sqrt(3.0) * Q16
        ),
        # Clocks a unit of v_q17 are N V / vdc 2^-17; vdc counts in v_q25.
        **_gains(vector_scale_v=timing.carrier_cycles * Q8, vector_band=band),
        "vector_slope": min(round(slope * 2**shift), int(Q17) - 1),
        "vector_slope_shift": shift,
        "vector_dead_comp_cycles": lost,
        "vector_margin_cycles": margin_cycles(clock, inverter),
        "vector_miss_limit": MISS_LIMIT,
    }


def vector_parameters(
    motor: MotorSpec, inverter: InverterSpec, drive: DriveSpec, vector: VectorSpec, limit_a: float
) -> dict[str, Value]:
    """All parameters that only the vector drive has, and those that it has otherwise than six-step operation.

    limit_a: amplitude of the phase current. Values that do not fit raise ParameterError when the block is packed.
    """
    m = VectorMachine.of(motor, inverter)
    p, clock = motor.pole_pairs, drive.clock_hz
    timing = vector_timing(clock, drive.carrier_hz, inverter, vector)
    delay = timing.delay if vector.believed_delay is None else vector.believed_delay
    sample_s, tick_s = timing.sample_cycles / clock, timing.tick_cycles / clock
    # T_s V / (L I): current from voltage, both in parts of their full scale.
    admittance = sample_s * inverter.voltage_full_scale_v / (m.inductance_h * inverter.current_full_scale_a)
    # Flux of a salient machine: L_q i + (psi + (L_d - L_q) i_d) exp(j theta).
    observed = (m.inductance_h + motor.saliency_h / 2.0) / m.inductance_h
    unit_rad_s = 2.0 * math.pi * clock / Q36  # of a speed of 2^-36 turn a clock
    ampere = Q25 / inverter.current_full_scale_a
    # J/p domega/dt = T: k_p closes the loop at the bandwidth.
    speed_rad = 2.0 * math.pi * vector.speed_hz
    speed_kp = speed_rad * motor.inertia_kgm2 / (p * m.torque_nm_per_a) * unit_rad_s * ampere
    most_turns = min(SPEED_LIMIT_RATIO * OVERSPEED_RATIO * m.omega_max / (2 * math.pi), TURN_A_TICK_MAX / tick_s)
    return {
        "method": 1,
        "tick_cycles": timing.tick_cycles,
        "sample_mode": 2,
        "sample_offset_cycles": timing.offset_cycles,
        "vector_double": int(vector.double),
        "vector_direct": int(vector.current_regulator == "c"),
        "vector_sample_cycles": timing.sample_cycles,
        "vector_tick_samples": timing.tick_samples,
        "vector_from_cycles": timing.from_cycles,
        "vector_length_cycles": timing.length_cycles,
        "vector_resistance_q30": round(m.resistance_ohm / m.inductance_h * sample_s * Q30),
        "vector_observer_resistance_q30": round(m.resistance_ohm / (m.inductance_h * observed) * sample_s * Q30),
        "vector_delay_q30": round(min(delay, 1.0) * Q30),
        "vector_park": INVERSE_PARKS.index(vector.park),
        "vector_order": REGULATORS.index(vector.regulator),
        "vector_bandwidth_q30": round(2.0 * math.pi * vector.bandwidth_hz * sample_s * Q30),
        "vector_gamma_q30": round(vector.gamma * Q30),
        "vector_pole1_q30": round(vector.observer_pole * Q30),
        "vector_pole2_q30": round(vector.observer_pole * Q30),
        "vector_speed_max_turn_q36": round(most_turns / clock * Q36),
        **_gains(
            vector_admittance=admittance,
            vector_impedance=1.0 / admittance,
            vector_observer_admittance=admittance / observed,
            vector_observer_impedance=observed / admittance,
            vector_speed_kp=speed_kp,
            vector_speed_ki=speed_kp * speed_rad / KI_DIVISOR * tick_s * PI_INTEGRAL,
            vector_rpm_to_turn=p / 60.0 / Q8 / clock * Q36,
            vector_flux=m.psi_vs * unit_rad_s * Q25 / inverter.voltage_full_scale_v,
        ),
        **_pll(vector, timing, clock),
        **_start(motor, inverter, drive, vector, tick_s),
        **_weakening(motor, inverter, limit_a, vector, tick_s),
        **_encoder(motor, drive, vector),
        **_modulator(motor, inverter, drive, vector, timing),
        **injection_parameters(motor, inverter, drive, vector, timing),
    }
