"""Crossings of a machine whose phases differ in inductance, mutual inductance or EMF.

Pulse on, resistances left out, (3.12) generalised (docs/theory/six-step.md):

    v_O - Vdc/2 = e_O - (e_H + e_L)/2 - (L'_H - L'_L)/(L'_H + L'_L) (Vdc - e_H + e_L)/2
    L'_X        = L_X + M_YZ - M_XY - M_XZ
"""

from __future__ import annotations

import math

from fluxlock.analysis.angles import FLOATING_PHASE
from fluxlock.config.motor import Motor

# Upper and lower phase of sectors I, II, III; the opposite sectors have the same errors.
PAIRS = ((0, 1), (0, 2), (1, 2))
SEARCH_DEG = 60.0
STEPS = 60


def phase_inductances_h(motor: Motor) -> tuple[float, float, float]:
    """L' of phases A, B, C: inductances of the machine without mutual ones that has the same terminals."""
    (a, b, c), (ab, bc, ca) = motor.self_inductance_h, motor.mutual_h
    return a + bc - ab - ca, b + ca - ab - bc, c + ab - bc - ca


def crossing_errors_deg(motor: Motor, vdc_v: float, speed_rpm: float) -> tuple[float, float, float]:
    """How late the crossings of phases A, B, C come at a positive speed, sinusoidal EMF, threshold Vdc/2."""
    if motor.emf != "sinusoidal":
        raise ValueError(f"{motor.name}: the EMF is {motor.emf}, not sinusoidal")
    inductance = phase_inductances_h(motor)
    omega = motor.omega_e(speed_rpm)

    def emf(phase: int, prime_rad: float) -> float:
        return motor.psi_vs[phase] * omega * math.sin(prime_rad - phase * 2 * math.pi / 3)

    def excess_v(sector: int, prime_rad: float) -> float:
        """Voltage of the floating terminal above Vdc/2."""
        high, low = PAIRS[sector]
        e_high, e_low = emf(high, prime_rad), emf(low, prime_rad)
        unlike = (inductance[high] - inductance[low]) / (inductance[high] + inductance[low])
        own = emf(int(FLOATING_PHASE[sector]), prime_rad)
        return own - 0.5 * (e_high + e_low) - 0.5 * unlike * (vdc_v - e_high + e_low)

    errors = [0.0, 0.0, 0.0]
    for sector in range(3):
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
        errors[int(FLOATING_PHASE[sector])] = middle - ideal_deg
    return errors[0], errors[1], errors[2]
