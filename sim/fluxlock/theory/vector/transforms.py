# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Clarke and Park for three and five phases, amplitude-invariant: the length of a vector is the phases' peak.

Subspace 1 turns with theta and steps of 360/m degrees, subspace 3 (five phases) with 3 theta and 216 degrees.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fluxlock.results.rundata import FloatArray
from fluxlock.theory.vector.model import ComplexArray

HARMONICS: dict[int, tuple[int, ...]] = {3: (1,), 5: (1, 3)}  # subspaces by the number of phases


def _steps(phases: int, harmonic: int) -> ComplexArray:
    if harmonic not in HARMONICS.get(phases, ()):
        raise ValueError(f"{phases} phases, subspace {harmonic}: there are 3 phases with 1, 5 with 1 and 3")
    return np.asarray(np.exp(2j * np.pi * harmonic * np.arange(phases) / phases))


def to_dq(values: npt.ArrayLike, theta_rad: npt.ArrayLike, harmonic: int = 1) -> ComplexArray:
    """Vector d + jq of phase values [..., m] at rotor angles [...] (rad)."""
    phase = np.asarray(values, dtype=np.float64)
    m = phase.shape[-1]
    vector = 2.0 / m * (phase @ _steps(m, harmonic))
    return np.asarray(vector * np.exp(-1j * harmonic * np.asarray(theta_rad)))


def to_phases(dq: npt.ArrayLike, theta_rad: npt.ArrayLike, phases: int, harmonic: int = 1) -> FloatArray:
    """Phase values [..., m] of d + jq [...] at rotor angles [...]; those of several subspaces are added."""
    vector = np.asarray(dq) * np.exp(1j * harmonic * np.asarray(theta_rad))
    return np.asarray(np.real(vector[..., np.newaxis] * np.conj(_steps(phases, harmonic))))
