# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""From a scenario to the parameter block: every gain and start-up value follows from the files.

Symbols as in `design`. A function per group of parameters. Gains that do not fit raise ParameterError here, other
values when the block is packed.
"""

from __future__ import annotations

import math
from functools import reduce
from typing import Any

from fluxlock.clock import CLOCK_HZ
from fluxlock.config.drive import LOOP_FILTER_SHIFT, ZcdSampling
from fluxlock.config.motor import OVERLOAD_S, OVERSPEED_RATIO, RPM_PER_RAD_S
from fluxlock.config.scenario import Scenario
from fluxlock.config.vector_design import dead_time_cycles, min_pulse_cycles
from fluxlock.config.vector_modes import KI_DIVISOR
from fluxlock.firmware.block import ParameterBlock, Value, gain, shared_gains
from fluxlock.firmware.design import (
    BRAKE_MARGIN,
    INTERVAL_MAX_CYCLES,
    Q5,
    Q8,
    Q16,
    Q17,
    Q18,
    Q20,
    Q25,
    Q30,
    RPM_Q8,
    SPEED_DELAY_RAD,
    SPEED_DELAY_TURNS,
    Design,
    cycles,
)
from fluxlock.firmware.vector_compiler import vector_parameters
from fluxlock.interface.names import words
from fluxlock.interface.settings import load_settings

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
SAMPLE_MODES: dict[ZcdSampling, int] = {"continuous": 1, "carrier": 3}
# Fastest trim of the EMF line by the measured current.
TRIM_S = 5e-3
LIMITER_BANDWIDTH_RAD = 600.0
# A rotor driven by the forced field leads it so far that only a part of its EMF opposes the voltage.
START_EMF_SHARE = 0.85
# Six times the crossings that the lock needs (sw/drive/six_step/start.c), in intervals at the hand-over speed.
LOCK_INTERVALS = 72.0
DIVIDER_TOLERANCE = 0.1
# Above noise and offset; where a decaying current is slow each step of it counts.
FREEWHEEL_LSB = 4.0
# Correction B: bandwidth over that of the speed loop, largest share of an error taken off in one turn.
BALANCE_BANDWIDTH_RATIO = 1.5
BALANCE_SHARE_A_TURN = 0.4
# Catching: speed over that of the hand-over.
CATCH_SPEED_RATIO = 1.25
# Line EMF over a diode's drop: below, too much of the terminal voltages is cut off.
CATCH_DIODES = 3.6
# A voltage channel that keeps its value for so long, and for so many turns at the lowest speed of catching: a terminal
# may stay at its rail for half of one.
STUCK_S = 0.05
STUCK_TURNS = 1.0
# Sensor whose edge leads into a sector at positive speed.
HALL_SENSOR = (2, 1, 0, 2, 1, 0)
# Hall edges that stay away for so many intervals at the hand-over speed: the rotor is blocked.
HALL_STALL_INTERVALS = 6.0
# In which a stop must slow the rotor: with the slow protection's two looks around it 50 ms.
STOP_PATIENCE_S = 35e-3


def compile_parameters(s: Scenario) -> ParameterBlock:
    """All parameters of the firmware."""
    d = Design(_with_told_inertia(s))
    groups = (
        *(_settings, _sampling, _power_stage, _protection, _brake_switch, _plausibility),
        *(_speed, _machine, _carrier, _crossings, _balance, _hall, _commutation),
        *(_coasting, _alignment, _ramp, _handover, _limits, _current, _stop),
    )
    values: dict[str, Value] = {"clock_hz": round(CLOCK_HZ), "method": 0, "tick_cycles": cycles(d.tick_s)}
    for group in groups:
        values |= group(d)
    if s.drive.method == "vector":
        values |= vector_parameters(d)
    return ParameterBlock(values)


def _with_told_inertia(s: Scenario) -> Scenario:
    """The scenario with the inertia that `drive.motor_error` asks for; `Machine` has its other wrong values."""
    inertia = s.motor.inertia_kgm2 * s.drive.motor_error.inertia
    return s.model_copy(update={"motor": s.motor.model_copy(update={"inertia_kgm2": inertia})})


def _settings(d: Design) -> dict[str, Value]:
    """What the settings begin with, where a key of the scenario says it."""
    values: dict[str, Value] = {}
    for setting in load_settings():
        if setting.file:
            stated: Any = reduce(getattr, setting.file.split("."), d.s.drive)
            values[setting.parameter] = setting.number_of(False if stated is None else stated)
    return values


def _sampling(d: Design) -> dict[str, Value]:
    sensing = d.s.inverter.sensing
    return {
        "sample_mode": SAMPLE_MODES[d.s.drive.zcd.sampling],
        "sample_period_cycles": cycles(sensing.sample_period_s),
        "sample_offset_cycles": cycles(d.offset_s),
        "sense_delay_cycles": cycles(sensing.divider_pole_s),
        "voltage_full_scale_mv": round(1e3 * sensing.voltage_full_scale_v),
        "current_full_scale_ma": round(1e3 * sensing.current_full_scale_a),
    }


def _power_stage(d: Design) -> dict[str, Value]:
    inverter = d.s.inverter
    return {
        "gate_polarity": inverter.gate_polarity,
        "dead_time_cycles": dead_time_cycles(inverter),
        "min_pulse_cycles": min_pulse_cycles(inverter),
        "precharge_ticks": d.ticks(inverter.precharge_s),
        "latency_cycles": cycles(inverter.gate_delay_s),
        "diode_v_q25": round(inverter.diode_drop_v * d.volt),
        "slew_v_q25": max(1, round(inverter.supply_v * d.tick_s / 5e-3 * d.volt)),
    }


def _protection(d: Design) -> dict[str, Value]:
    inverter, protection = d.s.inverter, d.s.inverter.protection
    full_a = inverter.sensing.current_full_scale_a
    return {
        "trip_phase_lsb": round(d.trip_a / full_a * d.half_codes),
        "trip_dc_lsb": round(d.visible_a(protection.dc_current_a) / full_a * d.half_codes),
        "trip_over_voltage_lsb": d.code(inverter.over_voltage_v),
        "trip_under_voltage_lsb": d.code(inverter.under_voltage_v),
        "watchdog_cycles": WATCHDOG_TICKS * cycles(d.tick_s),
        "safe_state": int(protection.safe_state == "short"),
    }


def _brake_switch(d: Design) -> dict[str, Value]:
    """The chip's brake pin, and the age of the samples at which the chip turns it and the gates off."""
    brake, drive = d.s.inverter.brake_chopper, d.s.drive
    driven = brake if brake is not None and brake.longest_on_s else None
    once_cycles = cycles(d.longest_s) if drive.zcd.sampling == "carrier" else 0
    period_cycles = max(cycles(d.s.inverter.sensing.sample_period_s), once_cycles)
    return {
        "brake_on_lsb": d.code(driven.on_v) if driven else 0,
        "brake_off_lsb": d.code(driven.off_v) if driven else 0,
        "brake_longest_cycles": cycles(driven.longest_on_s or 0.0) if driven else 0,
        "sample_age_cycles": min(SAMPLE_AGE_MAX, SAMPLE_AGE_SETS * period_cycles),
    }


def _plausibility(d: Design) -> dict[str, Value]:
    motor, inverter = d.s.motor, d.s.inverter
    amp_q17 = d.ampere / Q8
    return {
        "rated_i_q17": min(Q17, round(d.s.rated_current_a * amp_q17)),
        "overload_ticks": round((OVERLOAD_S if motor.overload_s is None else motor.overload_s) / d.tick_s),
        "sum_limit_q17": round(max(SUM_RATED_SHARE * d.s.rated_current_a * amp_q17, SUM_LSB * Q17 / d.half_codes)),
        "still_ticks": d.ticks(STILL_S) if inverter.sensing.noise_lsb >= STILL_NOISE_LSB else 0,
        "vdc_min_q17": d.v_q17(inverter.under_voltage_v + 0.1 * inverter.supply_v),
        "vdc_max_q17": d.v_q17(min(inverter.over_voltage_v, 0.99 * inverter.sensing.voltage_full_scale_v)),
        "overspeed_rpm": round(OVERSPEED_RATIO * motor.max_speed_rpm),
    }


def _machine(d: Design) -> dict[str, Value]:
    m, motor = d.machine, d.s.motor
    lines = (r * d.volt / (d.ampere / Q8) for r in (m.line_ohm, m.line_ohm_at_max_speed))
    (low, high), shift = shared_gains("resistance", *lines)
    return {
        "pole_pairs": motor.pole_pairs,
        "speed_max_rpm": round(motor.max_speed_rpm),
        "emf": gain(m.k_e * d.volt / RPM_Q8, "emf"),
        "speed_ratio": gain(Q16 / (motor.max_speed_rpm * Q8), "speed_ratio"),
        "resistance_low": low,
        "resistance_high": high,
        "damping_q16": min(128 * Q16, round((d.damping_ohm / m.line_ohm - 1.0) * Q16)),
        "resistance_shift": shift,
    }


def _carrier(d: Design) -> dict[str, Value]:
    drive, sensing = d.s.drive, d.s.inverter.sensing
    return {
        "carrier_period_cycles": cycles(1.0 / drive.carrier_hz),
        "carrier_longest_cycles": cycles(d.longest_s),
        "restart_carriers": d.restart_carriers,
        "firm_restart_carriers": d.firm_restart_carriers,
        "on_time_floor_cycles": cycles(d.settle_s + 4.0 * sensing.sample_period_s),
        "least_on_cycles": cycles(d.settling.least_s),
        "duty_max_q30": round(drive.duty_max * Q30),
    }


def _crossings(d: Design) -> dict[str, Value]:
    zcd, m, inverter = d.s.drive.zcd, d.machine, d.s.inverter
    # Nothing tells that a sample once a carrier falls into the end of freewheeling: the first one after a commutation
    # does not count.
    blank_s = d.settle_s if zcd.sampling == "continuous" else d.offset_s + inverter.sensing.sample_period_s
    margin_v = max(0.03 * inverter.supply_v, 12.0 * d.step_v)
    peak_vs = (1.5 if m.sinusoidal else 1.0) * d.s.motor.pole_pairs * m.psi_vs
    return {
        "zcd_linear": int(not m.sinusoidal),
        "zcd_peak": gain(peak_vs * (d.volt / Q8) / RPM_Q8, "zcd_peak"),
        "zcd_settle_cycles": cycles(d.settle_s),
        "zcd_blank_cycles": cycles(blank_s),
        # A divider whose gain is too small shows a clamped terminal below the rail.
        "zcd_margin_q17": d.v_q17(margin_v + DIVIDER_TOLERANCE * inverter.supply_v),
        "zcd_margin_third_q17": d.v_q17(margin_v),
        "zcd_threshold_q17": tuple(round(share * Q17) for share in zcd.threshold),
        "freewheel_limit_q17": round(FREEWHEEL_LSB * Q17 / d.half_codes),
        "miss_limit": zcd.miss_limit,
    }


def _balance(d: Design) -> dict[str, Value]:
    """Correction B: slope of the floating voltage at its crossing over the line EMF, per radian."""
    zcd, m = d.s.drive.zcd, d.machine
    if zcd.balance_bandwidth_hz is not None:
        bandwidth = 2.0 * math.pi * zcd.balance_bandwidth_hz
    else:
        bandwidth = BALANCE_BANDWIDTH_RATIO * d.bandwidth
    slope = (1.5 if m.sinusoidal else 6.0 / math.pi) * d.s.motor.pole_pairs * m.psi_vs / m.k_e
    return {
        "balance_step": gain(bandwidth * 2.0 * math.pi / CLOCK_HZ * slope * Q25 / 6.0, "balance_step"),
        "balance_turn_cycles": max(256, min(INTERVAL_MAX_CYCLES, cycles(BALANCE_SHARE_A_TURN / bandwidth))),
    }


def _turn60(degrees: float) -> int:
    """Electrical angle in parts of 2^-16 of a sector."""
    return max(-0x8000, min(0x7FFF, round(degrees / 60.0 * Q16)))


def _hall(d: Design) -> dict[str, Value]:
    hall, motor = d.s.drive.hall, d.s.motor
    # From standstill to the hand-over speed at a third of the start current's torque.
    start_s = 0.05 + 3.0 * d.w_handover * motor.inertia_kgm2 / (d.machine.k_e * d.start_a)
    calm_s = 1.2 * math.pi / (3.0 * motor.pole_pairs * d.w_coast)
    return {
        "hall_mode": words("hall_mode").index(hall.mode),
        "hall_filter_cycles": cycles(hall.filter_s),
        "hall_late_q16": tuple(_turn60(hall.offset_deg[x]) for x in HALL_SENSOR),
        "hall_calm_ticks": d.ticks(calm_s),
        "hall_stall_ticks": d.ticks(max(HALL_STALL_INTERVALS * d.handover_interval_s, 2.0 * calm_s)),
        "hall_start_ticks": d.ticks(start_s),
    }


def _commutation(d: Design) -> dict[str, Value]:
    drive = d.s.drive
    return {
        "advance_q16": _turn60(drive.advance_deg),
        "advance_speed_q16": _turn60(drive.advance_deg_at_max_speed),
        "advance_current_q16": _turn60(drive.advance_deg_at_rated_current),
        "rated_current_ratio": gain(Q16 / (d.s.rated_current_a * d.ampere), "rated_current_ratio"),
    }


def _coasting(d: Design) -> dict[str, Value]:
    """A rotor that spins: wait until it is slow, or catch it."""
    m, p = d.machine, d.s.motor.pole_pairs
    catch_v = max(
        CATCH_SPEED_RATIO * m.line_emf_peak * p * d.w_handover,
        CATCH_DIODES * d.s.inverter.diode_drop_v,
        40.0 * d.step_v,
    )
    turn_s = 2.0 * math.pi * m.line_emf_peak / catch_v
    return {
        "coast_v_q17": d.v_q17(max(m.line_emf_peak * p * d.w_coast, 20.0 * d.step_v)),
        "coast_timeout_ticks": d.ticks(30.0),
        "catch": int(d.s.drive.start.catch),
        "catch_v_q17": d.v_q17(catch_v),
        "catch_speed": gain(60.0 / (2.0**24 * p * d.tick_s) * Q8, "catch_speed"),
        "stuck_ticks": d.ticks(max(STUCK_S, STUCK_TURNS * turn_s)),
    }


def _alignment(d: Design) -> dict[str, Value]:
    return {
        "align_ticks": d.ticks(d.align_s),
        "align_ramp_ticks": d.ticks(0.2 * d.align_s),
        "align_v_q25": max(1, round(1.5 * d.machine.resistance_ohm * d.start_a * d.volt)),
        "align_limit_q17": max(1, min(Q17, round(ALIGN_LIMIT * d.start_a * (d.ampere / Q8)))),
    }


def _ramp(d: Design) -> dict[str, Value]:
    first_s = math.sqrt(math.pi / 3.0 / (d.s.motor.pole_pairs * d.ramp_rad_s2))
    return {
        "start_v_q25": max(1, round(d.start_v * d.volt)),
        "start_emf": gain(START_EMF_SHARE * d.machine.k_e * d.volt / RPM_Q8, "start_emf"),
        "start_first_cycles": cycles(first_s),
        "start_accel_rpm_q20": max(1, round(d.ramp_rad_s2 * RPM_PER_RAD_S * d.tick_s * Q20)),
    }


def _handover(d: Design) -> dict[str, Value]:
    start = d.s.drive.start
    return {
        "handover_rpm": max(1, round(d.w_handover * RPM_PER_RAD_S)),
        "handover_interval_cycles": cycles(d.handover_interval_s),
        "lock_timeout_ticks": d.ticks(LOCK_INTERVALS * d.handover_interval_s + 5e-3),
        "start_retries": start.retries,
        "restart_retries": start.restart_retries,
        "restart_clear_ticks": d.ticks(1.0),
    }


def _speed(d: Design) -> dict[str, Value]:
    """Speed regulator: its current accelerates the inertia, and takes the measured speed out of the EMF line."""
    m, motor = d.machine, d.s.motor
    bandwidth = min(d.bandwidth, d.current_bandwidth / 3.0)
    per_rpm = d.ampere / RPM_Q8
    inertia = motor.inertia_kgm2 * bandwidth / m.k_e * per_rpm
    stiffness = SPEED_DELAY_RAD * m.k_e / d.damping_ohm * per_rpm
    (kp_inertia, kp_stiffness), kp_shift = shared_gains("speed_kp", inertia, stiffness)
    # The speed is a mean over one electrical turn, and late by SPEED_DELAY_TURNS of it.
    scale = SPEED_DELAY_RAD / SPEED_DELAY_TURNS * motor.pole_pairs / (60.0 * Q8) / bandwidth * Q16
    carrier_s = 1.0 / d.s.drive.carrier_hz
    return {
        "target_rpm": 0,
        "accel_rpm_s": max(1, round(d.s.accel_rpm_per_s)),
        "speed_kp_inertia": kp_inertia,
        "speed_kp_stiffness": kp_stiffness,
        "speed_kp_shift": kp_shift,
        "speed_wt_q16": max(1, round(bandwidth / KI_DIVISOR * d.tick_s * Q5 * Q16)),
        "current_accel": gain(m.k_e / motor.inertia_kgm2 * d.tick_s / d.ampere * RPM_PER_RAD_S * Q18, "current_accel"),
        "speed_lag_q16": max(1, round(bandwidth * d.tick_s / SPEED_DELAY_RAD * Q16)),
        "discontinuous_q16": round(min(1.0, d.damping_ohm * carrier_s / (2.0 * m.line_h)) * Q16),
        "boundary_current": gain(4096.0 / (2.0 * m.line_h * CLOCK_HZ) * d.ampere / d.volt, "boundary_current"),
        "freewheel_limit": int(d.s.drive.freewheel_limit and d.s.drive.hall.mode != "sensored"),
        "rectify_light": int(d.s.drive.sync_rect is None),
        "speed_bandwidth_scale": gain(scale, "speed_bandwidth_scale"),
        "accel_feed_forward_s": gain(Q8 / bandwidth, "accel_feed_forward_s"),
        "ramp_end_q16": max(1, round(d.tick_s / (2.0 * d.lag_s) * Q16)),
        "ramp_window_rpm": max(1, round(0.05 * motor.max_speed_rpm)),
    }


def _limits(d: Design) -> dict[str, Value]:
    m, inverter, limit_a = d.machine, d.s.inverter, d.s.current_limit_a
    brake_a = d.s.drive.brake_current_limit_a
    if brake_a is None:
        brake_a = min(0.5 * d.s.rated_current_a, limit_a)
    from_v, to_v = (inverter.supply_v + x * (inverter.over_voltage_v - inverter.supply_v) for x in BRAKE_MARGIN)
    kp_ohm = max(LIMITER_BANDWIDTH_RAD * m.line_h - m.line_ohm, 0.5 * m.line_ohm)
    amp_q17 = d.ampere / Q8
    return {
        "current_limit_ma": round(1e3 * limit_a),
        "dc_current_limit_ma": round(1e3 * limit_a),
        "brake_limit_ma": round(1e3 * brake_a),
        "brake_vdc_v_q25": round(to_v * d.volt),
        "brake_range": gain(Q16 / ((to_v - from_v) * d.volt), "brake_range"),
        "limiter_kp": gain(kp_ohm * d.volt / amp_q17, "limiter_kp"),
        "limiter_ki": gain(200.0 * d.tick_s * m.line_ohm * d.volt / amp_q17, "limiter_ki"),
    }


def _current(d: Design) -> dict[str, Value]:
    """Current regulator: with current loop a PI that cancels the pole R(n)/L, without a slow trim of the EMF line."""
    m, drive, bandwidth = d.machine, d.s.drive, d.current_bandwidth
    trim_s = max(TRIM_S, 4.0 * d.lag_s)
    torque_nm = 1e-3 * (drive.torque_mnm or 0.0)
    return {
        "target_i_q25": max(-Q25, min(Q25, round(torque_nm / m.k_e * d.ampere))),
        "torque_to_current": gain(1e-6 / m.k_e * d.ampere, "torque_to_current"),
        "current_kp": gain(m.line_h * bandwidth * d.volt / d.ampere, "current_kp"),
        "current_wt_q16": max(1, round(bandwidth * d.tick_s * Q16)),
        "pair_inductance": gain(m.line_h / d.tick_s * d.volt / d.ampere, "pair_inductance"),
        "pair_spring": gain(m.k_e**2 * d.tick_s / d.s.motor.inertia_kgm2 * d.volt / d.ampere, "pair_spring"),
        "trim_kp": gain(max(d.damping_ohm - m.line_ohm, 1e-3 * m.line_ohm) * d.volt / d.ampere, "trim_kp"),
        "trim_wt_q16": max(1, round(d.damping_ohm / m.line_ohm * d.tick_s / trim_s * Q16)),
        "loop_filter_shift": LOOP_FILTER_SHIFT,
    }


def _stop(d: Design) -> dict[str, Value]:
    return {
        "stop_rpm": max(1, round(1.1 * d.w_handover * RPM_PER_RAD_S)),
        "stop_timeout_ticks": d.ticks(20.0),
        "stop_patience_ticks": d.ticks(STOP_PATIENCE_S),
    }
