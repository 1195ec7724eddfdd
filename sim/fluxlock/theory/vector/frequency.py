# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Frequency responses of the sampled current loop: tracking P and decoupling Q, (7.32), bandwidth and margins.

A complex loop answers +f and -f differently, so that a figure of merit is the worse of both. f is the frequency in the
rotor's frame.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fluxlock.results.rundata import FloatArray
from fluxlock.theory.vector.controllers import Gains
from fluxlock.theory.vector.model import Coefficients, ComplexArray

GRID = 40_000  # points from 0 to f_s / 2
LOWEST = 1e-5  # of f_s


def _at(polynomial: ComplexArray, z: ComplexArray) -> ComplexArray:
    found = np.zeros_like(z)
    for coefficient in polynomial:
        found = found * z + coefficient
    return found


@dataclass(frozen=True)
class Loop:
    """Open loop N / D in z, coefficients from the highest power on."""

    numerator: ComplexArray
    denominator: ComplexArray

    def open(self, z: ComplexArray) -> ComplexArray:
        """Open loop at points of the z plane."""
        return _at(self.numerator, z) / _at(self.denominator, z)

    def closed(self, z: ComplexArray) -> ComplexArray:
        """H = I / I*."""
        return _at(self.numerator, z) / _at(self._sum, z)

    @property
    def _sum(self) -> ComplexArray:
        return np.asarray(np.polyadd(self.denominator, self.numerator))

    @property
    def poles(self) -> ComplexArray:
        """Poles of the closed loop."""
        return np.asarray(np.roots(self._sum))

    @property
    def stable(self) -> bool:
        """Whether all poles that the loop's input excites lie inside the unit circle."""
        return bool(np.all(np.abs(self.poles) < 1.0))


def plant_zero(model: Coefficients) -> ComplexArray:
    """Zero of the plant, -Gamma2 / Gamma1 (7.18); infinite at T_d = T_s."""
    with np.errstate(divide="ignore", invalid="ignore"):
        zero = -model.gamma2 / model.gamma1
    return np.asarray(np.where(model.gamma1 == 0, np.inf, zero))


def current_loop(model: Coefficients, chosen: Gains) -> Loop:
    """Controller (g z - h) / (z - 1) with the plant (Gamma1 z + Gamma2) / (z (z - Phi)), (7.18)."""
    numerator = np.polymul([chosen.g, -chosen.h], [complex(model.gamma1), complex(model.gamma2)])
    denominator = np.polymul([1.0, -1.0, 0.0], [1.0, -complex(model.phi)])
    return Loop(np.asarray(numerator, dtype=np.complex128), np.asarray(denominator, dtype=np.complex128))


def on_circle(frequency: npt.ArrayLike) -> ComplexArray:
    """Points of the unit circle at frequencies over f_s."""
    return np.asarray(np.exp(2j * np.pi * np.asarray(frequency, dtype=np.float64)))


def tracking_decoupling(loop: Loop, frequency: npt.ArrayLike) -> tuple[ComplexArray, ComplexArray]:
    """P and Q of (7.32) at frequencies over f_s: i_d = P i_d* - Q i_q*, i_q = Q i_d* + P i_q*.

    With H' the loop of conjugate coefficients, H'(z) = conj(H(conj(z))): P = (H + H') / 2, Q = (H - H') / 2j.
    """
    z = on_circle(frequency)
    h, mirrored = loop.closed(z), np.conj(loop.closed(np.conj(z)))
    return np.asarray((h + mirrored) / 2), np.asarray((h - mirrored) / 2j)


def _grid() -> FloatArray:
    return np.linspace(LOWEST, 0.5, GRID)


def _first(frequency: FloatArray, value: FloatArray, level: float) -> float:
    """Lowest frequency at which value falls through level, between points linearly; nan without one."""
    below = np.flatnonzero(value < level)
    if not below.size or below[0] == 0:
        return math.nan
    k = int(below[0])
    part = (value[k - 1] - level) / (value[k - 1] - value[k])
    return float(frequency[k - 1] + part * (frequency[k] - frequency[k - 1]))


def tracking_bandwidth(loop: Loop) -> float:
    """Frequency over f_s at which |P| falls to -3 dB."""
    f = _grid()
    return _first(f, np.abs(tracking_decoupling(loop, f)[0]), math.sqrt(0.5))


def phase_bandwidth(loop: Loop) -> float:
    """Frequency over f_s at which the current lags its reference by 90 degrees (or leads at -f); the lower of both."""
    f = _grid()
    found = []
    for sign in (1.0, -1.0):
        phase = np.unwrap(np.angle(loop.closed(on_circle(sign * f)))) * sign
        found.append(_first(f, np.degrees(phase), -90.0))
    return min(found, key=lambda value: math.inf if math.isnan(value) else value)


def phase_margin_deg(loop: Loop) -> float:
    """Least distance of the open loop's phase from 180 degrees where its size is 1, over both signs of f (deg).

    Negative if the closed loop is unstable.
    """
    f = _grid()
    margins = []
    for sign in (1.0, -1.0):
        value = loop.open(on_circle(sign * f))
        size = np.abs(value) - 1.0
        for k in np.flatnonzero(np.sign(size[1:]) != np.sign(size[:-1])):
            part = size[k] / (size[k] - size[k + 1])
            at = value[k] + part * (value[k + 1] - value[k])
            margins.append(float(np.degrees(np.abs(np.angle(-at)))))
    least = min(margins, default=math.inf)
    return least if loop.stable else -least


def gain_margin(loop: Loop) -> float:
    """Factor on the open loop at which the closed loop becomes unstable, by bisection on its poles; 0 if it is."""
    if not loop.stable:
        return 0.0
    low, high = 1.0, 2.0
    while Loop(loop.numerator * high, loop.denominator).stable:
        low, high = high, 2.0 * high
        if high > 1e6:
            return math.inf
    for _ in range(50):
        middle = (low + high) / 2
        if Loop(loop.numerator * middle, loop.denominator).stable:
            low = middle
        else:
            high = middle
    return low
