# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""From machine, inverter and drive to the parameter block: every gain and start-up value follows from the files.

Symbols: psi phase flux (peak), p pole pairs, R_l line resistance 2 (R + R_on), k_e mean line EMF of the conducting
pair per mechanical speed (= torque per ampere), w mechanical and w_e electrical speed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from fluxlock.firmware.block import ParameterBlock, Value, gain, shared_gains
from fluxlock.firmware.specs import (
    BALANCES,
    COMMUTATIONS,
    HALL_MODES,
    LOOP_FILTER_SHIFT,
    OVERLOAD_S,
    OVERSPEED_RATIO,
    PATTERNS,
    ZCD_METHODS,
    ZCD_SOURCES,
    DriveSpec,
    InverterSpec,
    MotorSpec,
    ZcdSampling,
    current_bandwidth_max_hz,
    least_pulse_s,
    over_voltage_limit,
    settling_s,
)
from fluxlock.firmware.vector_compiler import vector_parameters
from fluxlock.firmware.vector_timing import vector_timing

RPM = 60.0 / (2.0 * math.pi)  # r/min of 1 rad/s
Q5, Q8, Q16, Q17, Q20, Q25, Q30 = 2**5, 2**8, 2**16, 2**17, 2**20, 2**25, 2**30

# The watchdog waits for so many control steps, of which every fourth is told.
WATCHDOG_TICKS = 8
# Gates and brake switch turn off when that many sample sets in a row have stayed away; what the register holds.
SAMPLE_AGE_SETS = 4
SAMPLE_AGE_MAX = 2**20 - 1
# Sum of the phase currents that is none of noise and offsets: the larger of both.
SUM_RATED_SHARE = 0.1
SUM_LSB = 16.0
# A channel with that noise or more cannot keep its value for so long.
STILL_NOISE_LSB = 0.75
STILL_S = 25e-3

# Of the alignment current: a rotor that swings into its place, even from beside the dead point, stays below 1.6.
ALIGN_LIMIT = 2.0
# Share of the start current's torque that the open-loop ramp asks for: the rest is the margin against load.
RAMP_TORQUE_SHARE = 0.3
RAMP_SECTORS_MIN = 10
RAMP_STEP_MAX_RPM = 2**31 / Q20 - 1  # what a control tick can add
# Amplitude of the floating EMF at the end of a sector, in converter steps, from which crossings are trusted.
HANDOVER_LSB = 30.0
HANDOVER_SPEED_SHARE = 0.05
START_CARRIER_HZ = 8e3
SAMPLE_MODES: dict[ZcdSampling, int] = {"continuous": 1, "carrier": 3}
BANDWIDTH_HZ = 30.0
KI_DIVISOR = 5.0
LIMITER_BANDWIDTH_RAD = 600.0
# A rotor driven by the forced field leads it so far that only a part of its EMF opposes the voltage.
START_EMF_SHARE = 0.85
HANDOVER_FALLBACK = 8
CURRENT_BANDWIDTH_HZ = 100.0
DIVIDER_TOLERANCE = 0.1
# Above noise and offset; where a decaying current is slow each step of it counts.
FREEWHEEL_LSB = 4.0
CSC_TOLERANCE = 0.01
# Correction B: bandwidth over that of the speed loop, largest share of an error taken off in one turn, range.
BALANCE_BANDWIDTH_RATIO = 1.5
BALANCE_SHARE_A_TURN = 0.4
BALANCE_LIMIT = 0.15
# Catching: speed over that of the hand-over; the angle between two control ticks must stay below a third of a turn.
CATCH_SPEED_RATIO = 1.25
CATCH_TURNS_A_TICK = 0.28
# Line EMF over a diode's drop: below, too much of the terminal voltages is cut off.
CATCH_DIODES = 3.6
# Sensor whose edge leads into a sector at positive speed.
HALL_SENSOR = (2, 1, 0, 2, 1, 0)
# Hall edges that stay away for so many intervals at the hand-over speed: the rotor is blocked.
HALL_STALL_INTERVALS = 6.0
# Over-voltage margin used up by braking: the current falls to zero between these shares of supply to trip.
BRAKE_MARGIN = (0.3, 0.75)


@dataclass(frozen=True)
class _Machine:
    """Derived quantities in SI units."""

    k_e: float
    line_emf_peak: float  # V·s/rad electrical
    crossing_slope: float  # floating voltage at the sector's end over psi * w_e
    r_phase: float
    r_line: float
    l_line: float
    w_max: float
    r_high: float

    @staticmethod
    def of(motor: MotorSpec, inverter: InverterSpec) -> _Machine:
        sinusoidal = motor.emf == "sinusoidal"
        k_e = motor.pole_pairs * motor.psi_vs * (3.0 * math.sqrt(3.0) / math.pi if sinusoidal else 2.0)
        r_phase = motor.resistance_ohm + inverter.on_resistance_ohm
        w_max = motor.max_speed_rpm / RPM
        # A commutation costs L*I volt-seconds of the line, six times a turn: it acts like a resistance.
        r_commutation = 3.0 / math.pi * motor.pole_pairs * w_max * motor.inductance_h
        return _Machine(
            k_e=k_e,
            line_emf_peak=motor.psi_vs * (math.sqrt(3.0) if sinusoidal else 2.0),
            crossing_slope=0.75 if sinusoidal else 1.0,
            r_phase=r_phase,
            r_line=2.0 * r_phase,
            l_line=2.0 * motor.inductance_h,
            w_max=w_max,
            r_high=2.0 * r_phase + r_commutation,
        )


def _align_time_s(motor: MotorSpec, r_phase: float, current_a: float) -> float:
    """Time in which the rotor settles on a vector: 4.5 time constants of its slowest mode, 20 ms to 0.6 s.

    Stiffness 3/2 p^2 psi I; the legs shorted by the lower switches damp with 3/2 p^2 psi^2 / R.
    """
    p2 = 1.5 * motor.pole_pairs**2 * motor.psi_vs
    stiffness = p2 * current_a / motor.inertia_kgm2
    sigma = p2 * motor.psi_vs / r_phase / (2.0 * motor.inertia_kgm2)
    slowest = sigma if sigma**2 < stiffness else stiffness / (sigma + math.sqrt(sigma**2 - stiffness))
    return min(0.6, max(0.02, 4.5 / slowest))


def _braking_speed(motor: MotorSpec, r_phase: float, current_a: float) -> float:
    """Electrical speed below which the shorted machine stays under a peak current (infinite if it always does)."""
    reach = motor.psi_vs**2 - (current_a * motor.inductance_h) ** 2
    return math.inf if reach <= 0.0 else current_a * r_phase / math.sqrt(reach)


def compile_parameters(motor: MotorSpec, inverter: InverterSpec, drive: DriveSpec) -> ParameterBlock:
    """All parameters of the firmware. Gains that do not fit raise ParameterError here, other values when packed."""
    m = _Machine.of(motor, inverter)
    p = motor.pole_pairs
    clock, tick = drive.clock_hz, 1.0 / drive.tick_hz
    if drive.vector is not None:
        tick = vector_timing(clock, drive.carrier_hz, inverter, drive.vector).tick_cycles / clock
    volt = Q25 / inverter.voltage_full_scale_v
    volt_q17 = Q17 / inverter.voltage_full_scale_v
    v_lsb = inverter.voltage_full_scale_v / 2**inverter.bits
    half_codes = 2 ** (inverter.bits - 1)
    rpm_q8 = RPM * Q8
    amp_q17 = Q17 / inverter.current_full_scale_a

    def cycles(seconds: float) -> int:
        return round(seconds * clock)

    def ticks(seconds: float) -> int:
        return max(1, round(seconds / tick))

    # Currents.
    limit_a = drive.current_limit_a if drive.current_limit_a is not None else 1.2 * motor.rated_current_a
    dc_limit_a = drive.dc_current_limit_a if drive.dc_current_limit_a is not None else limit_a
    full_a = 0.97 * inverter.current_full_scale_a
    trip_a = inverter.phase_current_trip_a if inverter.phase_current_trip_a is not None else 2.0 * limit_a
    trip_a = min(trip_a, full_a)
    dc_trip_a = min(inverter.dc_current_trip_a if inverter.dc_current_trip_a is not None else trip_a, full_a)
    start_a = drive.start_current_a
    if start_a is None:
        start_a = min(0.35 * motor.rated_current_a, 0.6 * limit_a, 0.4 * trip_a)

    # Crossing detection.
    # A sample that counts follows one that is settled itself: a clamp shorter than the sample spacing would else go
    # unseen between an unsettled sample on its rise and one on its fall.
    settle_s = settling_s(inverter.sample_period_s, inverter.divider_pole_s)
    on_time_s = settle_s + 4.0 * inverter.sample_period_s
    least_on_s = least_pulse_s(inverter.sample_period_s, inverter.divider_pole_s)
    # Once a carrier: settled, and inside of the shortest pulse. Nothing tells that such a sample falls into the end of
    # freewheeling, so that the first one after a commutation does not count.
    offset_s = least_on_s - inverter.sample_period_s
    blank_s = settle_s if drive.zcd_sampling == "continuous" else offset_s + inverter.sample_period_s

    # Open-loop start.
    start_v = m.r_line * start_a
    w_signal = HANDOVER_LSB * v_lsb / (m.crossing_slope * motor.psi_vs * p)
    w_handover = max(w_signal, HANDOVER_SPEED_SHARE * m.w_max)
    longest_s = 1.0 / (drive.start_carrier_hz or START_CARRIER_HZ)
    longest_s = min(longest_s, math.pi / (3.0 * p * w_handover) / 6.0)
    # At hand-over a pulse must hold settled samples even in the longest carrier.
    w_samples = (1.1 * least_on_s / longest_s * inverter.supply_v - start_v) / m.k_e
    w_handover = min(max(w_handover, w_samples), 0.3 * m.w_max)
    longest_s = max(longest_s, 1.0 / drive.carrier_hz)
    accel = RAMP_TORQUE_SHARE * m.k_e * start_a / motor.inertia_kgm2
    accel = min(accel, p * w_handover**2 / (2.0 * RAMP_SECTORS_MIN * math.pi / 3.0))
    accel = max(accel, math.pi / 3.0 / p * (clock / 0xFFFFFF) ** 2)
    accel = min(accel, RAMP_STEP_MAX_RPM / RPM / tick)
    handover_interval_s = math.pi / (3.0 * p * w_handover)
    align_s = _align_time_s(motor, m.r_phase, start_a)
    w_coast = min(w_handover, _braking_speed(motor, m.r_phase, 0.6 * trip_a) / p)
    lock_crossings = 12

    # Speed control: PI that cancels the machine's pole tau_m = J R / (k_e k_t).
    if drive.speed_bandwidth_hz is not None:
        bandwidth = 2.0 * math.pi * drive.speed_bandwidth_hz
    else:
        bandwidth = min(2.0 * math.pi * BANDWIDTH_HZ, 0.3 * m.r_line / m.l_line)
    kp = [motor.inertia_kgm2 * r * bandwidth / m.k_e * volt / rpm_q8 for r in (m.r_line, m.r_high)]
    speed_kp, speed_kp_shift = shared_gains("speed_kp", *kp)
    ki = [max(m.k_e * bandwidth * volt / rpm_q8, gain_p * bandwidth / KI_DIVISOR) * tick * Q5 for gain_p in kp]
    speed_ki, speed_ki_shift = shared_gains("speed_ki", *ki)
    resistance, resistance_shift = shared_gains("resistance", *(r * volt / amp_q17 for r in (m.r_line, m.r_high)))
    if drive.accel_rpm_per_s is not None:
        accel_rpm_s = drive.accel_rpm_per_s
    else:
        accel_rpm_s = 0.3 * m.k_e * motor.rated_current_a / motor.inertia_kgm2 * RPM
    limiter_kp = max(LIMITER_BANDWIDTH_RAD * m.l_line - m.r_line, 0.5 * m.r_line) * volt / amp_q17
    limiter_ki = 200.0 * tick * m.r_line * volt / amp_q17

    # Current loop: PI that cancels the pole R(n)/L; the speed regulator gives its reference.
    amp_q25 = Q25 / inverter.current_full_scale_a
    if drive.current_bandwidth_hz is not None:
        current_bandwidth = 2.0 * math.pi * drive.current_bandwidth_hz
    else:
        current_bandwidth = 2.0 * math.pi * CURRENT_BANDWIDTH_HZ
    current_bandwidth = min(current_bandwidth, 2.0 * math.pi * current_bandwidth_max_hz(drive.tick_hz))
    outer_bandwidth = min(bandwidth, current_bandwidth / 3.0)
    outer_kp = motor.inertia_kgm2 * outer_bandwidth / m.k_e * amp_q25 / rpm_q8

    # Correction B: slope of the floating voltage at its crossing over the line EMF, per radian.
    if drive.balance_bandwidth_hz is not None:
        balance_bandwidth = 2.0 * math.pi * drive.balance_bandwidth_hz
    else:
        balance_bandwidth = BALANCE_BANDWIDTH_RATIO * bandwidth
    slope = (1.5 if motor.emf == "sinusoidal" else 6.0 / math.pi) * p * motor.psi_vs / m.k_e

    def code(volts: float) -> int:
        return int(min(2**inverter.bits - 1, round(volts / v_lsb)))

    once_cycles = cycles(longest_s) if drive.zcd_sampling == "carrier" else 0

    supply = inverter.supply_v
    over_v = inverter.over_voltage_v
    if over_v is None:
        over_v = over_voltage_limit(supply, inverter.voltage_full_scale_v)
    under_v = inverter.under_voltage_v if inverter.under_voltage_v is not None else 0.6 * supply

    def turn60(degrees: float) -> int:
        return max(-0x8000, min(0x7FFF, round(degrees / 60.0 * Q16)))

    brake_a = drive.brake_current_limit_a
    if brake_a is None:
        brake_a = min(0.5 * motor.rated_current_a, limit_a)
    brake_from_v, brake_to_v = (supply + share * (over_v - supply) for share in BRAKE_MARGIN)
    can_catch = p * OVERSPEED_RATIO * motor.max_speed_rpm / 60.0 * tick < CATCH_TURNS_A_TICK

    # By Hall: from standstill to the hand-over speed at a third of the start current's torque.
    hall_start_s = 0.05 + 3.0 * w_handover * motor.inertia_kgm2 / (m.k_e * start_a)
    hall_calm_s = 1.2 * math.pi / (3.0 * p * w_coast)

    def q17_volts(volts: float) -> int:
        return max(1, min(Q17, round(volts * volt_q17)))

    values: dict[str, Value] = {
        "clock_hz": round(clock),
        "tick_cycles": cycles(tick),
        "sample_mode": SAMPLE_MODES[drive.zcd_sampling],
        "sample_period_cycles": cycles(inverter.sample_period_s),
        "sample_offset_cycles": cycles(offset_s),
        "sense_delay_cycles": cycles(inverter.divider_pole_s),
        "gain_q15": (0x8000,) * 9,
        "auto_zero_log2": 6,
        "offset_limit_lsb": half_codes // 10,
        "voltage_full_scale_mv": round(1e3 * inverter.voltage_full_scale_v),
        "current_full_scale_ma": round(1e3 * inverter.current_full_scale_a),
        "gate_polarity": inverter.gate_polarity,
        "dead_time_cycles": max(2, math.ceil(inverter.dead_time_s * clock - 1e-6)),
        "min_pulse_cycles": max(1, math.ceil(inverter.min_pulse_s * clock - 1e-6)),
        "trip_enable": 0xFF,
        "trip_phase_lsb": round(trip_a / inverter.current_full_scale_a * half_codes),
        "trip_dc_lsb": round(dc_trip_a / inverter.current_full_scale_a * half_codes),
        "trip_over_voltage_lsb": code(over_v),
        "trip_under_voltage_lsb": code(under_v),
        "watchdog_cycles": WATCHDOG_TICKS * cycles(tick),
        "safe_state": 1 if inverter.safe_state == "short" else 0,
        "brake_on_lsb": code(inverter.brake.on_v) if inverter.brake else 0,
        "brake_off_lsb": code(inverter.brake.off_v) if inverter.brake else 0,
        "brake_longest_cycles": cycles(inverter.brake.longest_on_s) if inverter.brake else 0,
        "sample_age_cycles": min(SAMPLE_AGE_MAX, SAMPLE_AGE_SETS * max(cycles(inverter.sample_period_s), once_cycles)),
        "rated_i_q17": min(Q17, round(motor.rated_current_a * amp_q17)),
        "overload_ticks": round((OVERLOAD_S if motor.overload_s is None else motor.overload_s) / tick),
        "sum_limit_q17": round(max(SUM_RATED_SHARE * motor.rated_current_a * amp_q17, SUM_LSB * Q17 / half_codes)),
        "still_ticks": ticks(STILL_S) if inverter.noise_lsb >= STILL_NOISE_LSB else 0,
        "vdc_min_q17": q17_volts(under_v + 0.1 * supply),
        "vdc_max_q17": q17_volts(min(over_v, 0.99 * inverter.voltage_full_scale_v)),
        "overspeed_rpm": round(OVERSPEED_RATIO * motor.max_speed_rpm),
        "pole_pairs": p,
        "speed_max_rpm": round(motor.max_speed_rpm),
        "emf": gain(m.k_e * volt / rpm_q8, "emf"),
        "speed_ratio": gain(Q16 / (motor.max_speed_rpm * Q8), "speed_ratio"),
        "resistance_low": resistance[0],
        "resistance_high": resistance[1],
        "resistance_shift": resistance_shift,
        "commutation": COMMUTATIONS.index(drive.commutation),
        "pattern": PATTERNS.index(drive.pattern),
        "sync_rect": int(drive.sync_rect),
        "carrier_period_cycles": cycles(1.0 / drive.carrier_hz),
        "linearity": int(drive.linearity),
        "csc_tolerance_q16": round(CSC_TOLERANCE * Q16),
        "carrier_longest_cycles": cycles(longest_s),
        "on_time_floor_cycles": cycles(on_time_s),
        "least_on_cycles": cycles(least_on_s),
        "duty_max_q30": round(drive.duty_max * Q30),
        "diode_v_q25": round(inverter.diode_drop_v * volt),
        "slew_v_q25": max(1, round(supply * tick / 5e-3 * volt)),
        "zcd_method": ZCD_METHODS.index(drive.zcd_method),
        "zcd_source": ZCD_SOURCES.index(drive.zcd_source),
        "compute_back": int(drive.compute_back),
        "zcd_linear": int(motor.emf == "trapezoidal"),
        "zcd_peak": gain(
            (1.5 if motor.emf == "sinusoidal" else 1.0) * p * motor.psi_vs * volt_q17 / rpm_q8, "zcd_peak"
        ),
        "zcd_need_previous": 1,
        "zcd_settle_cycles": cycles(settle_s),
        "zcd_blank_cycles": cycles(blank_s),
        # A divider whose gain is too small shows a clamped terminal below the rail.
        "zcd_margin_q17": q17_volts(max(0.03 * supply, 12.0 * v_lsb) + DIVIDER_TOLERANCE * supply),
        "zcd_margin_third_q17": q17_volts(max(0.03 * supply, 12.0 * v_lsb)),
        "zcd_threshold_q17": tuple(round(t * Q17) for t in drive.thresholds),
        "freewheel_limit_q17": round(FREEWHEEL_LSB * Q17 / half_codes),
        "balance": BALANCES.index(drive.balance),
        "balance_step": gain(balance_bandwidth * 2.0 * math.pi / clock * slope * Q25 / 6.0, "balance_step"),
        "balance_turn_cycles": max(256, min(0xFFFFFF, cycles(BALANCE_SHARE_A_TURN / balance_bandwidth))),
        "balance_limit_q25": round(BALANCE_LIMIT * Q25),
        "correction_a": int(drive.correction_a),
        "hall_mode": HALL_MODES.index(drive.hall_mode),
        "hall_filter_cycles": cycles(drive.hall_filter_s),
        "hall_late_q16": tuple(turn60(drive.hall_offset_deg[x]) for x in HALL_SENSOR),
        "hall_learn": int(drive.hall_learn),
        "hall_calm_ticks": ticks(hall_calm_s),
        "hall_stall_ticks": ticks(max(HALL_STALL_INTERVALS * handover_interval_s, 2.0 * hall_calm_s)),
        "hall_start_ticks": ticks(hall_start_s),
        "delay_q16": 0x8000,
        "advance_q16": turn60(drive.advance_deg),
        "advance_speed_q16": turn60(drive.advance_deg_at_max_speed),
        "advance_current_q16": turn60(drive.advance_deg_at_rated_current),
        "rated_current_ratio": gain(Q16 / (motor.rated_current_a * amp_q25), "rated_current_ratio"),
        "latency_cycles": cycles(inverter.driver_delay_s),
        "timeout_q12": 0x1800,
        "miss_limit": drive.miss_limit,
        "coast_v_q17": q17_volts(max(m.line_emf_peak * p * w_coast, 20.0 * v_lsb)),
        "coast_timeout_ticks": ticks(30.0),
        "catch": int(drive.catch_rotor and can_catch),
        "catch_v_q17": q17_volts(
            max(
                CATCH_SPEED_RATIO * m.line_emf_peak * p * w_handover, CATCH_DIODES * inverter.diode_drop_v, 40.0 * v_lsb
            )
        ),
        "catch_speed": gain(60.0 / (2.0**24 * p * tick) * Q8, "catch_speed"),
        "precharge_ticks": ticks(inverter.precharge_s),
        "align_ticks": ticks(align_s),
        "align_ramp_ticks": ticks(0.2 * align_s),
        "align_v_q25": max(1, round(1.5 * m.r_phase * start_a * volt)),
        "align_limit_q17": max(1, min(Q17, round(ALIGN_LIMIT * start_a * amp_q17))),
        "start_v_q25": max(1, round(start_v * volt)),
        "start_emf": gain(START_EMF_SHARE * m.k_e * volt / rpm_q8, "start_emf"),
        "lock_v_q25": max(1, round(0.5 * start_v * volt)),
        "start_first_cycles": cycles(math.sqrt(math.pi / 3.0 / (p * accel))),
        "start_accel_rpm_q20": max(1, round(accel * RPM * tick * Q20)),
        "handover_rpm": max(1, round(w_handover * RPM)),
        "handover_interval_cycles": cycles(handover_interval_s),
        "handover_crossings": 6,
        "handover_fallback": HANDOVER_FALLBACK,
        "handover_timeout": 3 * HANDOVER_FALLBACK,
        "handover_tolerance_q16": round(0.25 * Q16),
        "lock_crossings": lock_crossings,
        "lock_timeout_ticks": ticks(6.0 * lock_crossings * handover_interval_s + 5e-3),
        "start_retries": drive.start_retries,
        "restart_retries": drive.restart_retries,
        "restart_clear_ticks": ticks(1.0),
        "target_rpm": round(drive.target_rpm),
        "accel_rpm_s": max(1, round(accel_rpm_s)),
        "speed_kp_low": speed_kp[0],
        "speed_kp_high": speed_kp[1],
        "speed_kp_shift": speed_kp_shift,
        "speed_ki_low": speed_ki[0],
        "speed_ki_high": speed_ki[1],
        "speed_ki_shift": speed_ki_shift,
        # The speed is a mean over one electrical turn: w_b may be at most 0.9 f_e for 60 degrees of phase margin.
        "speed_bandwidth_scale": gain(0.9 * p / (60.0 * Q8) / bandwidth * Q16, "speed_bandwidth_scale"),
        "accel_feed_forward_s": gain(Q8 / bandwidth, "accel_feed_forward_s"),
        "ramp_window_rpm": max(1, round(0.05 * motor.max_speed_rpm)),
        "current_limit_ma": round(1e3 * limit_a),
        "dc_current_limit_ma": round(1e3 * dc_limit_a),
        "brake_limit_ma": round(1e3 * brake_a),
        "brake_vdc_v_q25": round(brake_to_v * volt),
        "brake_range": gain(Q16 / ((brake_to_v - brake_from_v) * volt), "brake_range"),
        "limiter_kp": gain(limiter_kp, "limiter_kp"),
        "limiter_ki": gain(limiter_ki, "limiter_ki"),
        "current_filter_shift": 3,
        "current_loop": int(drive.current_loop),
        "mode": int(drive.mode == "torque"),
        "target_i_q25": max(-Q25, min(Q25, round(drive.target_torque_nm / m.k_e * amp_q25))),
        "torque_to_current": gain(1e-6 / m.k_e * amp_q25, "torque_to_current"),
        "speed_to_current_kp": gain(outer_kp, "speed_to_current_kp"),
        "speed_to_current_ki": gain(outer_kp * outer_bandwidth / KI_DIVISOR * tick * Q5, "speed_to_current_ki"),
        "current_kp": gain(m.l_line * current_bandwidth * volt / amp_q25, "current_kp"),
        "current_wt_q16": max(1, round(current_bandwidth * tick * Q16)),
        "loop_filter_shift": LOOP_FILTER_SHIFT,
        "stop_rpm": max(1, round(1.1 * w_handover * RPM)),
        "stop_timeout_ticks": ticks(20.0),
    }
    if drive.vector is not None:
        values |= vector_parameters(motor, inverter, drive, drive.vector, limit_a)
    return ParameterBlock(values)
