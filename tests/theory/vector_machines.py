# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Machine and sampling of the vector tests: Motor-I at 15 kHz, and a five-phase machine in phase variables."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.integrate import solve_ivp

from fluxlock.base.paths import ROOT
from fluxlock.config import load_motor
from fluxlock.theory.vector.model import SmoothMachine

FS_HZ = 15e3
MOTOR_1 = SmoothMachine.from_motor(load_motor(ROOT / "motors" / "motor-1.toml"))
DELAYS = (0.0, 0.25, 0.5, 0.75, 1.0)
SPEEDS_HZ = (750.0, 1500.0)


@dataclass(frozen=True)
class PhaseMachine:
    """Machine in phase variables, star without neutral: L di/dt = v - v_N - R i - e; psi_vs by harmonic (1, 3)."""

    r_ohm: float
    l_matrix_h: npt.NDArray[np.float64]
    psi_vs: dict[int, float]

    @property
    def phases(self) -> int:
        return int(self.l_matrix_h.shape[0])

    def advance(
        self, current: npt.NDArray[np.float64], volts: npt.NDArray[np.float64], theta: float, omega: float, dt: float
    ) -> npt.NDArray[np.float64]:
        """Phase currents after dt under constant phase voltages, the EMF turning on. By numerical integration."""
        inverse = np.linalg.inv(self.l_matrix_h)
        axes = 2 * np.pi / self.phases * np.arange(self.phases)

        def slope(t: float, i: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
            emf = sum(-h * psi * omega * np.sin(h * (theta + omega * t - axes)) for h, psi in self.psi_vs.items())
            drop = volts - self.r_ohm * i - emf
            return inverse @ (drop - drop.mean())

        if dt <= 0.0:
            return current
        return solve_ivp(slope, (0.0, dt), current, method="DOP853", rtol=1e-13, atol=1e-13).y[:, -1]


def circulant(first: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Inductances of equal phases: first row over the distance between two phases."""
    row = np.asarray(first, dtype=np.float64)
    return np.stack([np.roll(row, k) for k in range(row.size)])


THREE = PhaseMachine(0.020, circulant([22e-6, 0.0, 0.0]), {1: 1.0e-3})
# Subspaces of different inductance: L_h = sum of the row with cosines of 2 pi h k / 5.
FIVE = PhaseMachine(0.5, circulant([4e-3, 0.6e-3, -0.8e-3, -0.8e-3, 0.6e-3]), {1: 0.12, 3: 0.01})


def subspace(machine: PhaseMachine, harmonic: int) -> SmoothMachine:
    """What a subspace sees."""
    k = np.arange(machine.phases)
    inductance = float(machine.l_matrix_h[0] @ np.cos(2 * np.pi * harmonic * k / machine.phases))
    return SmoothMachine(machine.r_ohm, inductance, machine.psi_vs[harmonic])
