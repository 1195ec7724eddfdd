# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Feasible injection frequencies by the rule of B. Tian et al., IEEE Access 2019, (28) to (30).

    w_inj >= 10 |(-w (L_d - L_q) sin(2 e) / 2 + R) / ((L_d + L_q - (L_d - L_q) cos(2 e)) / 2)|
    w_inj  = w_sw / n,   w_inj >= 10 w

w: electrical speed, e: error of the estimate. Nominal: file values, e = 0. Strict: the largest
bound over speeds up to the highest, inductances within +-10 % of the file's, each for itself, and e within +-10
degrees.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fluxlock.config import Motor
from fluxlock.results.rundata import FloatArray

MARGIN = 10.0  # "much larger" of the rule
INDUCTANCE_ERROR = 0.10
ANGLE_ERROR_RAD = math.radians(10.0)
LEAST_SALIENCY = 1.02  # L_q / L_d below which there is nothing to see
MAP_POINTS = 61


@dataclass(frozen=True)
class Rule:
    """Machine of the rule: r_ohm, ld_h, lq_h, all above 0."""

    r_ohm: float
    ld_h: float
    lq_h: float

    @classmethod
    def from_motor(cls, motor: Motor) -> Rule:
        """Of a motor file; ValueError says why injection does not work with it."""
        l_d, l_q = motor.inductance_h[0], motor.inductance_q_h
        if l_q is None:
            raise ValueError(
                "inductance_q_h is missing: without saliency the current does not tell the angle; "
                "state L_q if there is one"
            )
        if not max(l_d, l_q) / min(l_d, l_q) >= LEAST_SALIENCY:
            text = f"inductance_q_h = {l_q:g} H differs from inductance_h = {l_d:g} H by less than 2 %"
            raise ValueError(f"{text}: no saliency to follow")
        if l_q < l_d:
            text = f"inductance_q_h = {l_q:g} H is below inductance_h = {l_d:g} H: the estimate would follow the q axis"
            raise ValueError(text)
        return cls(motor.resistance_ohm[0], l_d, l_q)

    def bound_hz(self, omega: npt.ArrayLike, error: npt.ArrayLike, of_d: float = 1.0, of_q: float = 1.0) -> FloatArray:
        """Least injection frequency (Hz) at a speed (electrical rad/s) and an angle error (rad).

        of_d, of_q: true inductances over those of the file.
        """
        w, e = np.asarray(omega, float), np.asarray(error, float)
        l_d, l_q = of_d * self.ld_h, of_q * self.lq_h
        above = -0.5 * w * (l_d - l_q) * np.sin(2 * e) + self.r_ohm
        below = 0.5 * (l_d + l_q - (l_d - l_q) * np.cos(2 * e))
        found = np.maximum(MARGIN * np.abs(above / below), MARGIN * np.abs(w)) / (2 * math.pi)
        return np.asarray(found)

    def strict_bound_hz(self, omega: float) -> float:
        """Largest bound up to a speed of either sign over the errors.

        Over the inductances it is largest at a corner, for numerator and denominator are linear in each; over speed at
        an end likewise; over the angle it is looked for on a grid.
        """
        errors = np.linspace(-ANGLE_ERROR_RAD, ANGLE_ERROR_RAD, 201)
        ends = (1.0 - INDUCTANCE_ERROR, 1.0 + INDUCTANCE_ERROR)
        found = [
            self.bound_hz(sign * omega, errors, of_d, of_q).max()
            for of_d, of_q, sign in itertools.product(ends, ends, (-1.0, 1.0))
        ]
        return float(max(found))

    def nominal_bound_hz(self, omega: float) -> float:
        """Bound at no error: file values, right estimate."""
        return float(self.bound_hz(omega, 0.0))


@dataclass(frozen=True)
class Choice:
    """An injection frequency f_sw / n and what the two forms of the rule say."""

    n: int
    hz: float
    nominal: bool
    strict: bool


@dataclass(frozen=True)
class Feasible:
    """Frequencies of a machine at a carrier (Hz) up to a mechanical speed (r/min); bounds in Hz."""

    carrier_hz: float
    speed_rpm: float
    nominal_hz: float
    strict_hz: float
    choices: tuple[Choice, ...]

    def largest_n(self, strict: bool) -> int:
        """The largest n that is accepted; 0: none."""
        return max((c.n for c in self.choices if (c.strict if strict else c.nominal)), default=0)


def feasible(rule: Rule, carrier_hz: float, speed_rpm: float, pole_pairs: int) -> Feasible:
    """All n up to one beyond the largest that the nominal rule accepts, and a few more."""
    omega = speed_rpm / 60.0 * 2 * math.pi * pole_pairs
    nominal, strict = rule.nominal_bound_hz(omega), rule.strict_bound_hz(omega)
    most = max(int(carrier_hz / nominal), 1) + 2
    found = tuple(
        Choice(n, carrier_hz / n, carrier_hz / n >= nominal, carrier_hz / n >= strict) for n in range(1, most + 1)
    )
    return Feasible(carrier_hz, speed_rpm, nominal, strict, found)


@dataclass(frozen=True)
class BoundMap:
    """The paper's Fig. 4 at a speed: least frequency (Hz) [errors of both L, angle errors]."""

    angle_deg: FloatArray
    inductance_percent: FloatArray
    bound_hz: FloatArray


def bound_map(rule: Rule, omega: float) -> BoundMap:
    """Over angle errors of +-10 degrees and errors of both inductances of +-10 %."""
    angle = np.linspace(-ANGLE_ERROR_RAD, ANGLE_ERROR_RAD, MAP_POINTS)
    change = np.linspace(-INDUCTANCE_ERROR, INDUCTANCE_ERROR, MAP_POINTS)
    rows = [rule.bound_hz(omega, angle, 1 + x, 1 + x) for x in change]
    return BoundMap(np.degrees(angle), 100 * change, np.array(rows))
