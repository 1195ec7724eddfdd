# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Phase-locked loop that follows the observer's EMF, second and third order, designed in z.

    theta^[k+1] = theta^[k] + T_s omega^[k] + a eps[k]
    omega^[k+1] = omega^[k] + T_s accel^[k] + b eps[k]       (second order: accel^ = 0)
    accel^[k+1] = accel^[k] + c eps[k]

With eps = theta - theta^ the error's polynomial in y = z - 1 is y^2 + a y + b T_s, or y^3 + a y^2 + b T_s y + c T_s^2:
its coefficients are those of (y + 1 - p1)(y + 1 - p2)..., p = exp(s T_s) with the poles s of the wanted loop.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from fluxlock.theory.vector.model import ComplexArray

Order = Literal[2, 3]
ORDERS: tuple[Order, ...] = (2, 3)
LARGEST = 0.2  # bandwidth times T_s


@dataclass(frozen=True)
class PllGains:
    """Gains a (no unit), b (1/s), c (1/s^2; 0 in the second order) on an angle in rad."""

    a: float
    b: float
    c: float = 0.0


def continuous_poles(order: Order, omega_n: float, damping: float) -> ComplexArray:
    """s^2 + 2 d w s + w^2, in the third order times (s + w); omega_n in rad/s."""
    pair = np.roots([1.0, 2.0 * damping * omega_n, omega_n**2]).astype(np.complex128)
    return np.asarray(pair if order == 2 else np.append(pair, -omega_n))


def natural_frequency(order: Order, bandwidth_hz: float, damping: float) -> float:
    """omega_n (rad/s) at which the loop's answer to the angle falls to -3 dB at bandwidth_hz, by bisection.

    The answer is 1 - s^n / (polynomial): second order (2 d w s + w^2) / (...), third order accordingly.
    """

    def answer(x: float) -> float:
        polynomial = np.poly(continuous_poles(order, 1.0, damping)).real
        s = 1j * x
        return abs(1.0 - s**order / complex(np.polyval(polynomial, s)))

    low, high = 1.0, 2.0
    while answer(high) > math.sqrt(0.5):
        low, high = high, 2.0 * high
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if answer(middle) > math.sqrt(0.5) else (low, middle)
    return 2.0 * math.pi * bandwidth_hz / low


def pll_gains(order: Order, bandwidth_hz: float, ts_s: float, damping: float = 1.0) -> PllGains:
    """Gains from the -3 dB bandwidth (Hz, below 0.2 / ts_s) and the damping (0.3 .. 3) of the pole pair."""
    if order not in ORDERS:
        raise ValueError(f"order = {order}: must be 2 or 3")
    if not 0.0 < bandwidth_hz * ts_s <= LARGEST:
        raise ValueError(
            f"bandwidth_hz = {bandwidth_hz:g}: must be above 0, at most {LARGEST / ts_s:g} ({LARGEST} / ts_s)"
        )
    if not 0.3 <= damping <= 3.0:
        raise ValueError(f"damping = {damping:g}: must be in 0.3 .. 3")
    poles = np.exp(continuous_poles(order, natural_frequency(order, bandwidth_hz, damping), damping) * ts_s)
    rest = np.poly(poles - 1.0).real
    return PllGains(float(rest[1]), float(rest[2] / ts_s), float(rest[3] / ts_s**2) if order == 3 else 0.0)


def error_poles(gains: PllGains, ts_s: float, sign: float = 1.0) -> ComplexArray:
    """Poles of the loop's error in z. sign: of the detector, eps = sign (theta - theta^); -1 runs away."""
    terms = [1.0, sign * gains.a, sign * gains.b * ts_s, sign * gains.c * ts_s**2]
    return np.asarray(1.0 + np.roots(terms if gains.c else terms[:3]).astype(np.complex128))


def acceleration_error_rad(
    gains: PllGains, ts_s: float, acceleration: float, observer_poles: Sequence[complex] = ()
) -> float:
    """Angle theta^ - theta (rad, small) in a steady acceleration (rad/s^2, electrical); 0 in the third order.

    The second order needs eps = T_s accel / b to follow, and then omega^ is a eps / T_s below omega: the observer sees
    the EMF turn at that difference and adds its own lag, sum 1 / (1 - p) samples less the half in whose middle the EMF
    of a sample counts.
    """
    if gains.c:
        return 0.0
    lag = sum(1.0 / (1.0 - p) for p in observer_poles) - 0.5 * bool(observer_poles)
    return -ts_s * acceleration / gains.b * (1.0 + gains.a * complex(lag).real)
