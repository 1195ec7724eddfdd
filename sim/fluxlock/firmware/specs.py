# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Plain records of machine, inverter and drive from which a parameter block is compiled.

They carry the keys of the TOML files that concern the firmware, checked by whoever reads those files. SI units.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from fluxlock.clock import CLOCK_HZ
from fluxlock.interface.kinds import Balance, Commutation, HallMode, Mode, Pattern, ZcdMethod, ZcdSource
from fluxlock.interface.names import words
from fluxlock.interface.settings import choices

Emf = Literal["sinusoidal", "trapezoidal"]
SafeState = Literal["off", "short"]
ZcdSampling = Literal["continuous", "carrier"]
CurrentWindow = Literal["sample", "carrier"]
Regulator = Literal["A", "B", "C"]
InversePark = Literal["held", "exact"]
FrameAngle = Literal["observer", "encoder"]
RegulatorPlace = Literal["rtl", "c"]
Mounting = Literal["given", "learnt"]
InjectionMethod = Literal["lock-in", "conventional", "iq", "separator"]
Sequence = Literal["held-tian", "held", "half-step", "exact"]
Compensation = Literal["off", "on", "following"]

COMMUTATIONS = choices("commutation")
PATTERNS = choices("pattern")
BALANCES = choices("balance")
ZCD_METHODS = choices("zcd_method")
ZCD_SOURCES = choices("zcd_source")
HALL_MODES = words("hall_mode")
REGULATORS: tuple[Regulator, ...] = ("A", "B", "C")
INVERSE_PARKS: tuple[InversePark, ...] = ("held", "exact")
INJECTION_METHODS: tuple[InjectionMethod, ...] = ("lock-in", "conventional", "iq", "separator")
SEQUENCES: tuple[Sequence, ...] = ("held-tian", "held", "half-step", "exact")

# Over-speed limit over the motor's highest speed.
OVERSPEED_RATIO = 1.25
# Time for which a machine bears twice its rated current where its file does not say.
OVERLOAD_S = 2.0
TICK_HZ = 10e3
# Phase that dead time (two ticks from the mean of the measurement to the mean of the voltage) and filter of the current
# loop may cost at its bandwidth.
CURRENT_LOOP_LAG_RAD = 0.7
LOOP_FILTER_SHIFT = 2
CURRENT_LOOP_LAG_TICKS = 2 + (1 << LOOP_FILTER_SHIFT)


@dataclass(frozen=True)
class EncoderSpec:
    """Incremental encoder. offset_deg: mechanical angle of the rotor at which the index begins."""

    lines: int
    index: bool = True
    offset_deg: float = 0.0


@dataclass(frozen=True)
class ThirdSpec:
    """Subspace 3 of a five-phase machine: inductances of its axes and between d and d, q and q of both, flux."""

    inductance_d_h: float
    inductance_q_h: float
    mutual_h: float
    psi_vs: float


@dataclass(frozen=True)
class MotorSpec:
    """Machine. Phase quantities are means over the phases; inductance is self minus mutual.

    emf_fundamental: fundamental of the phase EMF over its peak psi_vs * omega; saliency_h: L_q - L_d, of which
    inductance_h is the mean. curve_rad: angle from the saliency axis to the d axis over the powers 0 to 3 of i_q (A),
    which holds to +-curve_current_a; polarity_current_a: of i_d, at which saturation tells the poles apart.
    """

    pole_pairs: int
    resistance_ohm: float
    inductance_h: float
    psi_vs: float
    inertia_kgm2: float
    rated_current_a: float
    max_speed_rpm: float
    emf: Emf = "sinusoidal"
    emf_fundamental: float = 1.0
    saliency_h: float = 0.0
    encoder: EncoderSpec | None = None
    phases: int = 3
    third: ThirdSpec | None = None
    curve_rad: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    curve_current_a: float | None = None
    polarity_current_a: float | None = None
    overload_s: float | None = None


@dataclass(frozen=True)
class BrakeSpec:
    """Brake chopper that the chip drives: link voltages of its switch, longest time with it on."""

    on_v: float
    off_v: float
    longest_on_s: float


def over_voltage_limit(supply_v: float, full_scale_v: float) -> float:
    """Over-voltage trip of an inverter that states none: at the converter's full scale it could never be exceeded."""
    return min(1.25 * supply_v, 0.98 * full_scale_v)


@dataclass(frozen=True)
class InverterSpec:
    """Inverter with its sensing chain and protections; None chooses a value from the others.

    gate_polarity: bit 0, 1: upper, lower gate pins are active low.
    """

    supply_v: float
    on_resistance_ohm: float = 0.0
    diode_drop_v: float = 0.7
    dead_time_s: float = 200e-9
    min_pulse_s: float = 400e-9
    bits: int = 12
    sample_period_s: float = 1e-6
    voltage_full_scale_v: float = 30.0
    current_full_scale_a: float = 50.0
    divider_pole_s: float = 100e-9
    driver_delay_s: float = 0.0
    precharge_s: float = 2e-3
    gate_polarity: int = 0
    phase_current_trip_a: float | None = None
    dc_current_trip_a: float | None = None
    over_voltage_v: float | None = None
    under_voltage_v: float | None = None
    conversion_s: float = 0.4e-6
    noise_lsb: float = 0.0
    brake: BrakeSpec | None = None
    safe_state: SafeState = "off"


@dataclass(frozen=True)
class InjectionSpec:
    """Square-wave injection. period: updates; samples: of the converter, in a current sample."""

    method: InjectionMethod
    amplitude_v: float
    period: int
    sequence: Sequence = "exact"
    remove: bool = True
    samples: int = 1
    low_hz: float = 51.5
    third_ratio: float = 0.0
    speed_filter_hz: float = 50.0
    compensation: Compensation = "following"
    search: bool = True
    search_current_a: float | None = None
    search_rise_a_per_s: float | None = None


@dataclass(frozen=True)
class VectorSpec:
    """What the scenario asks of the vector drive; None chooses a value from machine and inverter.

    believed_delay: T_d over T_s that regulators, observer and inverse Park are told where it is not the right one;
    samples and updates keep the right one.
    """

    double: bool = True
    delay: float | None = None
    believed_delay: float | None = None
    window: CurrentWindow = "sample"
    regulator: Regulator = "C"
    current_regulator: RegulatorPlace = "rtl"
    park: InversePark = "exact"
    bandwidth_hz: float = 800.0
    gamma: float = 0.35
    observer_pole: float = 0.7
    observer_every: int | None = None
    pll_hz: float = 200.0
    pll_order: int = 3
    start_current_a: float | None = None
    start_accel_rpm_per_s: float | None = None
    handover_rpm: float | None = None
    speed_hz: float = 20.0
    weakening: bool = False
    dead_time_compensation: bool = True
    angle: FrameAngle = "observer"
    mounting: Mounting = "given"
    injection: InjectionSpec | None = None


@dataclass(frozen=True)
class DriveSpec:
    """What the scenario asks of the drive; None chooses a value from machine and inverter.

    vector: None is six-step operation. Its samples, not tick_hz, then give the control tick.
    """

    clock_hz: float = CLOCK_HZ
    tick_hz: float = TICK_HZ
    commutation: Commutation = "CSC"
    pattern: Pattern = "ON-PWM"
    carrier_hz: float = 40e3
    start_carrier_hz: float | None = None
    sync_rect: bool = False
    current_limit_a: float | None = None
    dc_current_limit_a: float | None = None
    start_current_a: float | None = None
    target_rpm: float = 0.0
    accel_rpm_per_s: float | None = None
    speed_bandwidth_hz: float | None = None
    advance_deg: float = 0.0
    advance_deg_at_max_speed: float = 0.0
    advance_deg_at_rated_current: float = 0.0
    duty_max: float = 1.0
    zcd_method: ZcdMethod = "averaged"
    zcd_source: ZcdSource = "terminal"
    zcd_sampling: ZcdSampling = "continuous"
    compute_back: bool = False
    correction_a: bool = False
    thresholds: tuple[float, float, float, float, float, float] = (0.5, 0.5, 0.5, 0.5, 0.5, 0.5)
    miss_limit: int = 6
    hall_mode: HallMode = "off"
    hall_filter_s: float = 1e-6
    hall_offset_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)  # sensors A, B, C: how late at positive speed
    hall_learn: bool = True
    start_retries: int = 3
    restart_retries: int = 3
    catch_rotor: bool = True
    brake_current_limit_a: float | None = None
    balance: Balance = "none"
    balance_bandwidth_hz: float | None = None
    linearity: bool = False
    current_loop: bool = False
    mode: Mode = "speed"
    target_torque_nm: float = 0.0
    current_bandwidth_hz: float | None = None
    vector: VectorSpec | None = None


def current_bandwidth_max_hz(tick_hz: float) -> float:
    """Highest bandwidth of the current loop (Hz)."""
    return CURRENT_LOOP_LAG_RAD * tick_hz / (2.0 * math.pi * CURRENT_LOOP_LAG_TICKS)


def settling_s(sample_period_s: float, divider_pole_s: float) -> float:
    """Time from a gate edge until a sample counts (s): it follows one that is settled itself."""
    return max(0.4e-6, 6.0 * divider_pole_s) + sample_period_s


def least_pulse_s(sample_period_s: float, divider_pole_s: float) -> float:
    """Shortest pulse that holds the settled samples of a crossing (s)."""
    return settling_s(sample_period_s, divider_pole_s) + 3.0 * sample_period_s
