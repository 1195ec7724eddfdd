# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Crossings of a machine whose phases differ in inductance, mutual inductance, EMF or divider.

Pulse on, resistances left out, (3.12) generalised (docs/theory/six-step.md):

    v_O - Vdc/2 = e_O - (e_H + e_L)/2 - (L'_H - L'_L)/(L'_H + L'_L) (Vdc - e_H + e_L)/2
    L'_X        = L_X + M_YZ - M_XY - M_XZ
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from fluxlock.config.motor import Motor
from fluxlock.results.angles import FLOATING_PHASE

# Upper and lower phase of sectors I to VI.
PAIRS = ((0, 1), (0, 2), (1, 2), (1, 0), (2, 0), (2, 1))
SEARCH_DEG = 60.0
STEPS = 60


def phase_inductances_h(motor: Motor) -> tuple[float, float, float]:
    """L' of phases A, B, C: inductances of the machine without mutual ones that has the same terminals."""
    (a, b, c), (ab, bc, ca) = motor.self_inductance_h, motor.mutual_h
    return a + bc - ab - ca, b + ca - ab - bc, c + ab - bc - ca


def sector_errors_deg(
    motor: Motor,
    vdc_v: float,
    speed_rpm: float,
    divider_gain: Sequence[float] = (1.0, 1.0, 1.0),
    drop_v: float = 0.0,
) -> tuple[float, ...]:
    """How late the crossings of sectors I to VI come at a positive speed, sinusoidal EMF, thresholds Vdc/2, deg.

    divider_gain: of phases A, B, C over the nominal one; the threshold on the terminal is Vdc/2 over the gain.
    drop_v: what the current loses on the resistances of the line, in the middle: the inductances divide so much less.
    """
    if motor.emf != "sinusoidal":
        raise ValueError(f"{motor.name}: the EMF is {motor.emf}, not sinusoidal")
    inductance = phase_inductances_h(motor)
    omega = motor.omega_e(speed_rpm)

    def emf(phase: int, prime_rad: float) -> float:
        return motor.psi_vs[phase] * omega * math.sin(prime_rad - phase * 2 * math.pi / 3)

    def excess_v(sector: int, prime_rad: float) -> float:
        """Voltage of the floating terminal above its threshold."""
        high, low = PAIRS[sector]
        floating = int(FLOATING_PHASE[sector])
        e_high, e_low = emf(high, prime_rad), emf(low, prime_rad)
        unlike = (inductance[high] - inductance[low]) / (inductance[high] + inductance[low])
        above = emf(floating, prime_rad) - 0.5 * (e_high + e_low) - 0.5 * unlike * (vdc_v - drop_v - e_high + e_low)
        return above - 0.5 * vdc_v * (1.0 / divider_gain[floating] - 1.0)

    errors = []
    for sector in range(len(PAIRS)):
        ideal_deg = 60.0 + 60.0 * sector
        before, after = ideal_deg - SEARCH_DEG, ideal_deg + SEARCH_DEG
        sign = excess_v(sector, math.radians(before)) > 0
        if (excess_v(sector, math.radians(after)) > 0) == sign:
            raise ValueError(f"{motor.name}: no crossing within {SEARCH_DEG:g} deg of its place at {speed_rpm:g} r/min")
        for _ in range(STEPS):
            middle = 0.5 * (before + after)
            if (excess_v(sector, math.radians(middle)) > 0) == sign:
                before = middle
            else:
                after = middle
        errors.append(middle - ideal_deg)
    return tuple(errors)


def crossing_errors_deg(
    motor: Motor, vdc_v: float, speed_rpm: float, drop_v: float = 0.0
) -> tuple[float, float, float]:
    """The same of phases A, B, C with equal dividers, where opposite sectors have the same errors."""
    errors = sector_errors_deg(motor, vdc_v, speed_rpm, drop_v=drop_v)
    a, b, c = (errors[int(np.flatnonzero(phase == FLOATING_PHASE)[0])] for phase in range(3))
    return a, b, c


def crossing_intervals_deg(errors_deg: Sequence[float]) -> tuple[float, ...]:
    """Angles from the crossing before to each of six, from how late they come."""
    return tuple(60.0 + late - errors_deg[k - 1] for k, late in enumerate(errors_deg))


def commutation_intervals_deg(errors_deg: Sequence[float]) -> tuple[float, ...]:
    """Angles from the commutation before to each of six, half the last crossing interval after its crossing."""
    intervals = crossing_intervals_deg(errors_deg)
    return tuple(1.5 * own - 0.5 * intervals[k - 1] for k, own in enumerate(intervals))
