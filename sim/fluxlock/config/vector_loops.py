# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Bandwidths of phase-locked loop and speed loop by rule, with their margins: docs/theory/vector.md, Bandwidths."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fluxlock.clock import CLOCK_HZ
from fluxlock.config.injection_rules import injection_loops
from fluxlock.config.motor import Motor
from fluxlock.config.scenario import Scenario
from fluxlock.config.vector import Vector
from fluxlock.config.vector_design import (
    DAMPING_SHARE,
    HANDOVER_SPEED_SHARE,
    dead_time_cycles,
    handover_rpm,
    regulator_damping,
    told_machine,
)
from fluxlock.config.vector_modes import KI_DIVISOR, PLL_BANDWIDTH, SPEED_TICKS, Plant, Point, growth
from fluxlock.config.vector_timing import TICK_HZ, vector_timing

PLL_MAX = 0.3  # bandwidth over tick frequency, a distance of the observer's poles from 1
NOMINAL_DEG, WORST_DEG = 55.0, 40.0  # phase margin with the file's machine, and with its L off by:
L_ERROR = 0.3
NOMINAL_MODULUS, WORST_MODULUS = 0.6, 0.4
DIP = 0.02  # of the highest speed, at a rated load step
RIPPLE_RATIO = 2.5  # second harmonic of the EMF over the speed regulator's bandwidth, at least
DIP_SHARE = 0.7  # of K_t I_r / (w_s w) that the dip comes to
NOISE_SHARE = 0.02  # of the rated current: rms of i_q from the converter's noise, at the lowest observed speed
# Speed from its least to its most, at the lowest observed speed, from which on what the dead time leaves gets a notch.
SIXTH_RIPPLE = 0.005
ACCELERATION_RATIO = 1.2  # least omega_n over sqrt(K_t I_max): the largest acceleration bends the angle by 0.19 rad
LEAST_RATIO = 3.0  # omega_n over w_s
LIGHT_SHARE = 0.05  # of the rated current: the least i_q at which the stator's mode has to fade
LIGHT_SPEEDS = (0.25, 0.5, 0.75, 1.0)  # of the highest
SPEED_HZ_MIN = 0.5
PLL_HZ_MIN = 25.0
SINE_MAX = 0.7  # of the angle that a wrong L makes
PLL_STEPS, SPEED_STEPS, FREQUENCIES = 20, 24, 220
OCTAVES = 4.3  # of w_s that are searched
KEPT = 0.9  # share of the largest w_s for which omega_n stays smaller

# Of the voltage that the dead time takes, what its compensation may leave; the switched inverter leaves half of that.
LEFT_SHARE = 1 / 3
REFERENCE_GAMMA, REFERENCE_POLE = (float(Vector.model_fields[k].default) for k in ("gamma", "observer_pole"))
QUANTUM_LSB = 1 / math.sqrt(12)

Complex = NDArray[np.complexfloating[Any, Any]]
Real = NDArray[np.float64]


@dataclass(frozen=True)
class Loops:
    """Bandwidths (Hz), phase margins (degrees; worst: the file's L off by 30 % at the limit), and what bound them."""

    pll_hz: float
    speed_hz: float
    nominal_deg: float
    worst_deg: float
    reason: str


@dataclass(frozen=True)
class _Margins:
    """Of several w_s at one omega_n."""

    nominal_deg: Real
    worst_deg: Real
    nominal: Real  # modulus
    worst: Real

    @property
    def kept(self) -> NDArray[np.bool_]:
        """Where the rule is kept."""
        return (
            (self.nominal_deg >= NOMINAL_DEG)
            & (self.worst_deg >= WORST_DEG)
            & (self.nominal >= NOMINAL_MODULUS)
            & (self.worst >= WORST_MODULUS)
        )


def _loop(s: Complex, omega_n: float, order: int, delay_s: float) -> tuple[Complex, Complex]:
    """Estimated angle and speed from the angle."""
    late = np.exp(-s * delay_s) / (s + omega_n) ** order
    if order == 2:
        return (2 * omega_n * s + omega_n**2) * late, s * omega_n**2 * late
    return (3 * omega_n * s**2 + 3 * omega_n**2 * s + omega_n**3) * late, s * (3 * omega_n**2 * s + omega_n**3) * late


def _observer_delay_s(plant: Plant) -> float:
    return 0.0 if plant.sensor_rad else plant.observer_pole / (1 - plant.observer_pole) * plant.tick_s


def _margin(open_loop: Complex) -> tuple[Real, Real]:
    """Phase margin (degrees) and modulus margin of each row; 0 where the closed loop is not stable."""
    phase = np.unwrap(np.angle(1 + open_loop), axis=1)
    # Two integrators: from -180 degrees at the lowest frequency 1 + L turns by half a turn forward.
    stable = np.abs(phase[:, -1] - phase[:, 0] - np.pi) < 1.7
    size = np.abs(open_loop)
    crossing = (size[:, :-1] >= 1) & (size[:, 1:] < 1)
    left = np.abs(180.0 + np.degrees(np.angle(open_loop[:, :-1])))
    left = np.where(left > 180.0, 360.0 - left, left)
    least = np.where(crossing, left, 180.0).min(axis=1)
    modulus = np.abs(1 + open_loop).min(axis=1)
    return np.where(stable & crossing.any(axis=1), least, 0.0), np.where(stable, modulus, 0.0)


def _margins(plant: Plant, omega_n: float, speeds: Real) -> _Margins:
    """The open loop i_q* -> i_q*, nominal and with a wrong L at the current's limit in either sense.

    A wrong L turns the current into an angle, sin(delta) = dL i / psi: the speed loop sees its own output (D), and the
    torque of a leading frame falls (a negative spring).
    """
    tick, k_t = plant.tick_s, plant.acceleration
    w = np.geomspace(speeds.min() / 30, 0.9 * np.pi / (SPEED_TICKS * tick), FREQUENCIES)
    s = 1j * w
    angle, speed = _loop(s, omega_n, plant.pll_order, _observer_delay_s(plant))
    z = np.exp(s * plant.sample_s)
    current = plant.gamma / (z * z - z + plant.gamma)
    hold = np.exp(-s * tick * SPEED_TICKS) * np.sinc(w * tick * SPEED_TICKS / 2 / np.pi)
    gain = speeds[:, None] / k_t * (1 + speeds[:, None] / KI_DIVISOR / s)
    found = []
    ratio = 0.0 if plant.sensor_rad else L_ERROR * plant.inductance_h / plant.psi_vs
    for share, i0 in ((0.0, 0.0), *((a, b) for a in (ratio, -ratio) for b in (plant.limit_a, -plant.limit_a))):
        sine = min(max(share * i0, -SINE_MAX), SINE_MAX)
        cosine = math.sqrt(1 - sine * sine)
        own = share / cosine
        torque = k_t * (cosine - i0 * sine * angle * own) / (s * s - k_t * i0 * sine * (1 - angle))
        degrees, modulus = _margin(gain * hold * current * speed * (torque + own))
        # The spring is stable up to 8/3 omega_n^2.
        firm = k_t * i0 * sine <= 2.2 * omega_n**2
        found.append((degrees * firm, modulus * firm))
    worst_deg = np.min([f[0] for f in found[1:]], axis=0)
    worst = np.min([f[1] for f in found[1:]], axis=0)
    return _Margins(found[0][0], worst_deg, found[0][1], worst)


def _noise_a(plant: Plant, omega_n: float, omega_s: float) -> float:
    """Rms of i_q* from the converter's noise at the lowest observed speed, or from a sensor's steps."""
    w = np.geomspace(omega_n / 100, np.pi / plant.tick_s, FREQUENCIES)
    s = 1j * w
    _, speed = _loop(s, omega_n, plant.pll_order, 0.0)
    if plant.sensor_rad:
        rms, shape = plant.sensor_rad, speed
    else:
        pole = plant.observer_pole
        z = np.exp(-s * plant.tick_s)
        seen = ((1 - pole) / (1 - pole * z)) ** 2 * (1 - z) * plant.inductance_h / plant.tick_s
        rms, shape = plant.noise_a, speed * seen / (plant.least_omega * plant.psi_vs)
    density = 2 * rms**2 * plant.tick_s * np.abs(shape) ** 2 / (2 * np.pi)
    return omega_s / plant.acceleration * math.sqrt(float(np.trapezoid(density, w)))


def across_ohm(plant: Plant) -> float:
    """Chord resistance, (4/pi) v / i, of what the dead time leaves at the light current."""
    return 4 / math.pi * plant.left_v / (LIGHT_SHARE * plant.rated_a)


def swings_by_dead_time(plant: Plant, speed_hz: float) -> bool:
    """Whether the speed regulator has to leave out the sixth harmonic of the voltage that the dead time leaves.

    A rectangle of v turns the EMF by 4/pi (1/5 + 1/7) v / E to either side; a regulator of w_s makes w_s / w of it in
    the rotor's speed.
    """
    if plant.sensor_rad:
        return False
    follows = min(2 * math.pi * speed_hz / plant.least_omega, 2 / RIPPLE_RATIO)
    turn = 4 / math.pi * (1 / 5 + 1 / 7) * plant.left_v / (plant.least_omega * plant.psi_vs)
    return 2 * follows * turn > SIXTH_RIPPLE


def _fades(plant: Plant, omega_n: float, omega_s: float, across: float) -> bool:
    if plant.sensor_rad:
        return True
    light = LIGHT_SHARE * plant.rated_a
    points = (Point(share * plant.omega_max, light, across) for share in LIGHT_SPEEDS)
    return all(growth(plant, point, omega_n, omega_s)[0] < 0.0 for point in points)


def permitted_ohm(plant: Plant, found: Loops) -> float:
    """Resistance across the light current from which on a mode grows, to 5 %."""
    omega_n, omega_s = found.pll_hz * _unit(plant), 2 * math.pi * found.speed_hz
    low, high = 0.0, 1e3 * plant.resistance_ohm + plant.omega_max * plant.inductance_h
    if _fades(plant, omega_n, omega_s, high):
        return math.inf
    while high - low > 0.05 * high:
        middle = (low + high) / 2
        low, high = (middle, high) if _fades(plant, omega_n, omega_s, middle) else (low, middle)
    return low


def _unit(plant: Plant) -> float:
    """omega_n over the bandwidth in Hz."""
    return 2 * math.pi / PLL_BANDWIDTH[plant.pll_order]


def _most_pll(plant: Plant) -> float:
    """Largest omega_n."""
    pole = 0.0 if plant.sensor_rad else plant.observer_pole
    return PLL_MAX * (1 - pole) / plant.tick_s * _unit(plant)


def _bound(plant: Plant, omega_n: float) -> tuple[float, str]:
    """Largest w_s that keeps the rule at an omega_n, and what bound it; 0 where none does."""
    tops = {
        "dip at a rated load step": DIP_SHARE * plant.acceleration * plant.rated_a / (DIP * plant.omega_max),
        "pll": omega_n / LEAST_RATIO,
    }
    unit = _noise_a(plant, omega_n, 1.0)
    # Without a sensor the bandwidth stays below the second harmonic of the EMF at that speed.
    most = math.inf if plant.sensor_rad else 2 * plant.least_omega / RIPPLE_RATIO
    if unit * most > NOISE_SHARE * plant.rated_a:
        tops["noise"] = NOISE_SHARE * plant.rated_a / unit
    reason = min(tops, key=lambda name: tops[name])
    speeds = tops[reason] * 2.0 ** -np.linspace(0.0, OCTAVES, SPEED_STEPS)
    kept = np.flatnonzero(_margins(plant, omega_n, speeds).kept)
    if not kept.size:
        return 0.0, "phase margin"
    return float(speeds[kept[0]]), reason if kept[0] == 0 else "phase margin"


def _pairs(plant: Plant, pll_hz: float | None, speed_hz: float | None) -> list[tuple[float, float, str]]:
    """omega_n, the w_s that belongs to it (0: the rule is not kept), what bound it; omega_n rises."""
    most = _most_pll(plant)
    least = min(
        max(PLL_HZ_MIN * _unit(plant), ACCELERATION_RATIO * math.sqrt(plant.acceleration * plant.limit_a)), most
    )
    steps = [pll_hz * _unit(plant)] if pll_hz is not None else [float(w) for w in np.geomspace(least, most, PLL_STEPS)]
    if speed_hz is None:
        return [(w, *_bound(plant, w)) for w in steps]
    given = 2 * math.pi * speed_hz
    return [(w, given if _margins(plant, w, np.array([given])).kept[0] else 0.0, "given") for w in steps]


@lru_cache(maxsize=256)
def loops(plant: Plant, pll_hz: float | None = None, speed_hz: float | None = None) -> Loops:
    """Bandwidths by rule where they are not given, and the margins.

    The largest w_s that keeps margins, dip and noise, with the smallest omega_n that comes near it; where the voltage
    that the dead time leaves would let the stator's mode grow, the pair with the largest w_s at which it fades.
    """
    pairs = _pairs(plant, pll_hz, speed_hz)
    best = max(pair[1] for pair in pairs)
    omega_n, omega_s, reason = next(pair for pair in pairs if pair[1] >= KEPT * best)
    if best == 0.0:
        omega_s, reason = 2 * math.pi * (speed_hz or SPEED_HZ_MIN), "no bandwidth keeps the margins"
        omega_n = max(pairs, key=lambda pair: float(_margins(plant, pair[0], np.array([omega_s])).nominal_deg[0]))[0]
    elif pll_hz is None and not _fades(plant, omega_n, omega_s, across_ohm(plant)):
        fast = sorted((pair for pair in pairs if pair[1] > 0.0), key=lambda pair: -pair[1])
        calm = (pair for pair in fast if _fades(plant, pair[0], pair[1], across_ohm(plant)))
        omega_n, omega_s, reason = next(calm, (*pairs[0][:2], ""))
        reason = "dead time" if reason else "dead time against the largest acceleration"
    if pll_hz is not None and speed_hz is not None:
        reason = "given"
    margins = _margins(plant, omega_n, np.array([omega_s]))
    degrees = float(margins.nominal_deg[0]), float(margins.worst_deg[0])
    return Loops(omega_n / _unit(plant), omega_s / (2 * math.pi), *degrees, reason)


def plant_of(s: Scenario) -> Plant:
    """A scenario as its loops see it, with the machine that the firmware is told."""
    m, v, sensing = told_machine(s), s.drive.vector, s.inverter.sensing
    timing = vector_timing(s.drive, s.inverter)
    sample_s = timing.sample_cycles / CLOCK_HZ
    taken_v = dead_time_cycles(s.inverter) / timing.carrier_cycles * s.inverter.supply_v
    code_a = sensing.current_full_scale_a / 2 ** (sensing.bits - 1)
    gamma = 2 * math.pi * v.bandwidth_hz * sample_s if v.regulator == "A" else v.gamma
    sensor_rad = 0.0
    if v.angle == "encoder" and s.motor.encoder is not None:
        sensor_rad = 2 * math.pi * s.motor.pole_pairs / (4 * s.motor.encoder.lines) * QUANTUM_LSB
    return Plant(
        resistance_ohm=m.resistance_ohm,
        inductance_h=m.inductance_h + m.saliency_h / 2,
        psi_vs=m.fundamental_vs,
        acceleration=m.torque_nm_per_a * s.motor.pole_pairs / s.motor.inertia_kgm2,
        omega_max=m.omega_max,
        least_omega=s.motor.omega_e(handover_rpm(s)),
        rated_a=s.motor.rated_current_a,
        limit_a=s.current_limit_a,
        sample_s=sample_s,
        tick_samples=timing.tick_samples,
        delay=min(max(timing.delay, 0.0), 1.0),
        gamma=gamma,
        damping=regulator_damping(m, v, sample_s),
        observer_pole=v.observer_pole,
        pll_order=v.pll_order,
        noise_a=math.hypot(sensing.noise_lsb, QUANTUM_LSB) * code_a * math.sqrt(2 / 3),
        left_v=taken_v * (LEFT_SHARE if v.dead_time_compensation else 1.0),
        sensor_rad=sensor_rad,
    )


def reference_plant(motor: Motor) -> Plant:
    """A motor at the rule's usual drive: 20 kHz, T_d = T_s, limit and full scale of the rated current and twice it.

    Its converter has 12 bits and 1 LSB of noise, and its dead time costs nothing.
    """
    resistance, ts = sum(motor.resistance_ohm) / 3, 1.0 / TICK_HZ
    saliency = motor.inductance_q_h - motor.inductance_h[0] if motor.inductance_q_h else 0.0
    inductance = motor.mean_inductance_h + saliency / 2
    flux = sum(motor.psi_vs) / 3 * motor.emf_fundamental
    omega_max = motor.omega_e(motor.max_speed_rpm)
    gamma = REFERENCE_GAMMA
    return Plant(
        resistance_ohm=resistance,
        inductance_h=inductance,
        psi_vs=flux,
        acceleration=motor.phases / 2 * motor.pole_pairs**2 * flux / motor.inertia_kgm2,
        omega_max=omega_max,
        least_omega=HANDOVER_SPEED_SHARE * omega_max,
        rated_a=motor.rated_current_a,
        limit_a=motor.rated_current_a,
        sample_s=ts,
        tick_samples=1,
        delay=1.0,
        gamma=gamma,
        damping=1.0 if saliency else math.exp(min(0.0, resistance / inductance * ts - DAMPING_SHARE * gamma)),
        observer_pole=REFERENCE_POLE,
        pll_order=3,
        noise_a=math.hypot(1.0, QUANTUM_LSB) * 2 * motor.rated_current_a / 2**11 * math.sqrt(2 / 3),
        left_v=0.0,
    )


def loops_of(s: Scenario) -> Loops:
    """Bandwidths of a scenario: the given ones, and by rule what is left out."""
    v = s.drive.vector
    if v.injection is not None:
        found = injection_loops(s)
        return Loops(found.pll_hz, found.speed_hz, math.nan, math.nan, "injection")
    return loops(plant_of(s), v.pll_hz, v.speed_hz)
