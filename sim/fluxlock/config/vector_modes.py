# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Modes of the whole vector drive about a speed and a load: regulator, machine, observer, phase-locked loop, speed.

Small signals in the rotor's frame, real, in the order in which chip and firmware do them: so many samples per control
tick, four ticks per step of the speed loop. A voltage that the dead time leaves is a resistance across the current:
docs/theory/vector.md, Bandwidths.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[np.float64]

SPEED_TICKS = 4  # of a step of the speed loop
KI_DIVISOR = 4.0  # k_i = k_p w_s / this
# -3 dB bandwidth over omega_n of a phase-locked loop whose poles are all at omega_n, by order.
PLL_BANDWIDTH = {2: 2.4824, 3: 3.8989}
# States: vectors first, then what has one part.
CURRENT, ACTING, VOLTAGE, ERROR, SEEN_CURRENT, EMF, BEFORE, SUM = range(0, 16, 2)
FRAME, FRAME_SPEED, SPEED, LOOP_SPEED, SLOPE, TURN, REFERENCE, NEXT, INTEGRAL = range(16, 25)
STATES = 25


@dataclass(frozen=True)
class Plant:
    """Machine, inverter and settings as far as the loops see them; SI units, electrical angles.

    acceleration: rad/s^2 per ampere of i_q. least_omega: speed from which the frame is that of the EMF. left_v: what
    a leg loses beyond the compensation of its dead time. damping: zero of regulator C over the machine's pole.
    sensor_rad: rms of a sensor's angle, 0 for the EMF's.
    """

    resistance_ohm: float
    inductance_h: float
    psi_vs: float
    acceleration: float
    omega_max: float
    least_omega: float
    rated_a: float
    limit_a: float
    sample_s: float
    tick_samples: int
    delay: float
    gamma: float
    damping: float
    observer_pole: float
    pll_order: int
    noise_a: float
    left_v: float
    sensor_rad: float = 0.0

    @property
    def tick_s(self) -> float:
        """Control tick."""
        return self.sample_s * self.tick_samples


@dataclass(frozen=True)
class Point:
    """Where the machine turns: electrical speed (rad/s), i_q (A), resistance across the current (ohm)."""

    omega: float
    current_a: float
    across_ohm: float = 0.0


def _times(z: complex) -> Matrix:
    """A complex factor on d and q."""
    return np.array([[z.real, -z.imag], [z.imag, z.real]])


def _column(z: complex) -> Matrix:
    return np.array([z.real, z.imag])


def _integral(plant: Plant, point: Point, time_s: float) -> tuple[Matrix, Matrix]:
    """exp(A t) of the machine, and what a stationary voltage adds to the current meanwhile."""
    from scipy.linalg import expm  # slow to import: most commands never come here

    r, h, w = plant.resistance_ohm, plant.inductance_h, point.omega
    both = np.zeros((4, 4))
    both[:2, :2] = [[-(r + point.across_ohm) / h, w], [-w, -r / h]]
    both[:2, 2:] = np.eye(2) / h
    both[2:, 2:] = [[0.0, w], [-w, 0.0]]
    found = expm(both * time_s)
    return found[:2, :2], found[:2, 2:]


def _turn(angle: float) -> Matrix:
    return _times(complex(math.cos(angle), math.sin(angle)))


def _discrete(plant: Plant, omega: float) -> tuple[complex, complex, complex, complex]:
    """Phi, Gamma1, Gamma2 of a sample with the exact inverse Park, and Gamma_e."""
    r, h, ts = plant.resistance_ohm, plant.inductance_h, plant.sample_s
    td = plant.delay * ts
    back = np.exp(-1j * omega * ts)
    lead = np.exp(1j * omega * (td + ts / 2))
    rest = math.exp(-r / h * (ts - td))
    phi = math.exp(-r / h * ts) * back
    return (
        complex(phi),
        complex((1 - rest) / r * back * lead),
        complex((rest - math.exp(-r / h * ts)) / r * back * back * lead),
        complex((phi - 1) / (r + 1j * omega * h)),
    )


@lru_cache(maxsize=64)
def _sample(plant: Plant, point: Point) -> Matrix:
    """From sample to sample."""
    ts, td, w = plant.sample_s, plant.delay * plant.sample_s, point.omega
    phi, gamma1, gamma2, gamma_e = _discrete(plant, w)
    g = plant.gamma / (gamma1 + gamma2)
    h = g * phi * plant.damping
    i0 = 1j * point.current_a
    u0 = (plant.resistance_ohm + 1j * w * plant.inductance_h) * i0 + 1j * w * plant.psi_vs
    m = np.eye(STATES)
    error = np.zeros((2, STATES))
    error[:, CURRENT : CURRENT + 2] = -np.eye(2)
    error[:, FRAME] = _column(1j * i0)
    error[1, REFERENCE] += 1.0
    m[ERROR : ERROR + 2] = error
    m[VOLTAGE : VOLTAGE + 2] += _times(g) @ error
    m[VOLTAGE : VOLTAGE + 2, ERROR : ERROR + 2] -= _times(h)
    m[SUM : SUM + 2] += m[VOLTAGE : VOLTAGE + 2]
    acting = m[VOLTAGE : VOLTAGE + 2].copy()
    acting[:, FRAME] += _column(1j * u0)
    acting[:, FRAME_SPEED] += _column(1j * u0 * (td + ts / 2))
    acting[:, SPEED] -= _column(1j * u0 * (td + ts / 2))
    lead = _turn(w * (td + ts / 2))
    decay, _ = _integral(plant, point, ts)
    late, first = _integral(plant, point, ts - td)
    _, second = _integral(plant, point, td)
    current = np.zeros((2, STATES))
    current[:, CURRENT : CURRENT + 2] = decay
    current += first @ _turn(-w * td) @ lead @ acting
    current[:, ACTING : ACTING + 2] += late @ second @ _turn(-w * ts) @ lead
    current[:, SPEED] += _column(gamma_e * 1j * (plant.psi_vs + plant.inductance_h * i0))
    m[ACTING : ACTING + 2] = acting
    m[CURRENT : CURRENT + 2] = current
    m[FRAME, FRAME_SPEED] += ts
    m[FRAME, SPEED] -= ts
    m[SPEED, CURRENT + 1] += plant.acceleration * ts
    return m


def _joined(plant: Plant, omega: float) -> tuple[complex, complex, complex, complex]:
    """The model of a control tick (sw/control/vector_model.h)."""
    phi, gamma1, gamma2, gamma_e = _discrete(plant, omega)
    n = plant.tick_samples
    last, both = phi ** (n - 1), gamma1 + gamma2
    total = sum(phi**k for k in range(n))
    return phi**n, total * both - last * gamma2, last * gamma2, total * gamma_e


def _observe(plant: Plant, point: Point, m: Matrix) -> None:
    """The EMF observer's tick, in place: the correction has been taken."""
    w, n, i0 = point.omega, plant.tick_samples, 1j * point.current_a
    phi, gamma1, gamma2, gamma_e = _joined(plant, w)
    u0 = (plant.resistance_ohm + 1j * w * plant.inductance_h) * i0 + 1j * w * plant.psi_vs
    e0 = 1j * w * plant.psi_vs
    share = 1.0 - 2.0 * plant.observer_pole
    gain = (1.0 - plant.observer_pole) ** 2 / gamma_e
    old = np.eye(STATES)
    measured = -old[ERROR : ERROR + 2]
    measured[1, REFERENCE] += 1.0
    seen, before, now = (old[k : k + 2] for k in (SEEN_CURRENT, BEFORE, VOLTAGE))
    if n > 1:
        before = (old[SUM : SUM + 2] + before - now) / n
        seen = seen + _times(gamma1) @ before
    error = measured - seen
    ahead = _times(phi) @ measured + share * error + _times(gamma2) @ before + _times(gamma_e) @ old[EMF : EMF + 2]
    ahead[:, LOOP_SPEED] -= _column(1j * phi * i0 * plant.tick_s)
    if n == 1:
        ahead = ahead + _times(gamma1) @ now
    emf, voltage = old[EMF : EMF + 2] + _times(gain) @ error, now.copy()
    for vector, rest in ((ahead, i0), (emf, e0), (voltage, u0)):
        vector[:, TURN] -= _column(1j * rest)
    m[SEEN_CURRENT : SEEN_CURRENT + 2] = ahead
    m[EMF : EMF + 2] = emf
    m[BEFORE : BEFORE + 2] = voltage
    m[SUM : SUM + 2] = 0.0


def loop_gains(order: int, omega_n: float, tick_s: float) -> tuple[float, float, float]:
    """Of the angle, the speed (1/s) and its slope (1/s^2), a tick: all poles at exp(-omega_n T)."""
    q = -math.expm1(-omega_n * tick_s)
    if order == 2:
        return 2 * q, q**2 / tick_s, 0.0
    return 3 * q, 3 * q**2 / tick_s, q**3 / tick_s**2


def _tick(plant: Plant, point: Point, omega_n: float, omega_s: float, stepped: bool) -> Matrix:
    """A control tick; stepped: with the speed loop."""
    take = np.eye(STATES)
    take[FRAME, TURN] = 1.0
    take[FRAME_SPEED] = take[LOOP_SPEED]
    taken = np.eye(STATES)
    _observe(plant, point, taken)
    taken[TURN] = 0.0
    taken[REFERENCE] = np.eye(STATES)[NEXT]
    angle, speed, slope = loop_gains(plant.pll_order, omega_n, plant.tick_s)
    ahead = np.zeros(STATES)
    ahead[EMF] = -1.0 / (point.omega * plant.psi_vs)
    follow = np.eye(STATES)
    follow[TURN] = angle * ahead
    follow[LOOP_SPEED] += speed * ahead
    follow[LOOP_SPEED, SLOPE] += plant.tick_s
    follow[SLOPE] += slope * ahead
    regulate = np.eye(STATES)
    if stepped:
        k_p = omega_s / plant.acceleration
        regulate[NEXT] = 0.0
        regulate[NEXT, LOOP_SPEED], regulate[NEXT, INTEGRAL] = -k_p, 1.0
        regulate[INTEGRAL, LOOP_SPEED] -= k_p * omega_s / KI_DIVISOR * SPEED_TICKS * plant.tick_s
    return regulate @ follow @ taken @ take


def growth(plant: Plant, point: Point, omega_n: float, omega_s: float) -> tuple[float, float]:
    """Growth (1/s) and frequency (Hz) of the mode that fades last."""
    samples = np.linalg.matrix_power(_sample(plant, point), plant.tick_samples)
    plain = _tick(plant, point, omega_n, omega_s, False) @ samples
    whole = np.linalg.matrix_power(plain, SPEED_TICKS - 1)
    whole = _tick(plant, point, omega_n, omega_s, True) @ samples @ whole
    values = np.linalg.eigvals(whole)
    worst = values[np.argmax(np.abs(values))]
    span = SPEED_TICKS * plant.tick_s
    return math.log(max(abs(worst), 1e-12)) / span, abs(float(np.angle(worst))) / span / (2 * math.pi)
