# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Constants of a data sheet in every convention.

Psi is the peak EMF of a phase over electrical speed (of a trapezoid its flat top), p the pole pairs. Each convention of
Kv and Ke is psi times p times a number that the shape of the EMF gives. Of a sinusoid: phase-peak 1, phase-rms
1/sqrt 2, line-peak sqrt 3, line-rms sqrt(3/2), dc 3 sqrt 3/pi (mean of the line EMF over a sector). Kt in dc is Ke in
dc; per peak of a sinusoidal phase current it is 3/2 p times the EMF's fundamental.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fluxlock.config.motor import RPM_PER_RAD_S, Motor, fundamental, line_mean

# Kinds of the constants. dc: per volt or ampere of the DC link in six-step operation, mean over a sector. line: between
# two terminals. phase: of one winding of the equivalent star. rms and peak: of a sinusoid, or of the EMF's own shape.
EMF_KINDS = ("dc", "line-peak", "line-rms", "phase-peak", "phase-rms")
CURRENT_KINDS = ("peak", "rms", "dc")


Angles = NDArray[np.float64]
TURN: Angles = (np.arange(3600, dtype=np.float64) + 0.5) * (2 * math.pi / 3600)


def phase_emf(emf: str, flat_top_deg: float, theta: Angles) -> Angles:
    """Phase EMF over its peak at electrical angles in rad, zero and rising at 0."""
    if emf == "sinusoidal":
        return np.asarray(np.sin(theta))
    slope = (math.pi - math.radians(flat_top_deg)) / 2
    folded = np.arcsin(np.sin(theta))  # -pi/2 to pi/2, a triangle
    return np.asarray(np.clip(folded / slope, -1.0, 1.0))


def emf_factors(emf: str, flat_top_deg: float = 120.0) -> dict[str, float]:
    """EMF of each kind over p psi Omega: numbers without unit."""
    phase = phase_emf(emf, flat_top_deg, TURN)
    line = phase - phase_emf(emf, flat_top_deg, TURN - 2 * math.pi / 3)
    return {
        "dc": line_mean(emf, flat_top_deg),
        "line-peak": math.sqrt(3.0) if emf == "sinusoidal" else float(line.max()),
        "line-rms": float(np.sqrt(np.mean(line**2))),
        "phase-peak": 1.0,
        "phase-rms": float(np.sqrt(np.mean(phase**2))),
    }


def torque_factors(emf: str, flat_top_deg: float = 120.0) -> dict[str, float]:
    """Torque over current of each kind, over p psi."""
    of_sine = 1.5 * fundamental(emf, flat_top_deg)
    return {
        "peak": of_sine,
        "rms": math.sqrt(2.0) * of_sine,
        "dc": line_mean(emf, flat_top_deg),
    }


def constants(motor: Motor) -> dict[str, float]:
    """Kv in r/min/V, Ke in V per 1000 r/min and Kt in N m/A of a three-phase motor, each in every kind."""
    p_psi = motor.pole_pairs * sum(motor.psi_vs) / 3
    emf = emf_factors(motor.emf, motor.flat_top_deg)
    torque = torque_factors(motor.emf, motor.flat_top_deg)
    found = {f"kv_{kind.replace('-', '_')}_rpm_per_v": RPM_PER_RAD_S / (emf[kind] * p_psi) for kind in EMF_KINDS[:3]}
    found |= {f"ke_{k.replace('-', '_')}_v_per_krpm": 1e3 / RPM_PER_RAD_S * emf[k] * p_psi for k in EMF_KINDS}
    return found | {f"kt_{kind}_nm_per_a": torque[kind] * p_psi for kind in CURRENT_KINDS}
