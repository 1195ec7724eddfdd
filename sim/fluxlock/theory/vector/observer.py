# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""EMF observer for any delay, section 7.4, and its steady angle error.

    i^[k+1] = Phi i^[k] + Gamma1 u[k] + Gamma2 u[k-1] + Gamma_e e^[k] + G1 (i[k] - i^[k])
    e^[k+1] = e^[k] + G2 (i[k] - i^[k])                                              (7.42)

in the estimated frame, with the machine and the delay that the observer believes in. Error = estimate less truth; the
thesis reports the opposite.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fluxlock.results.rundata import FloatArray
from fluxlock.theory.vector.model import Coefficients, ComplexArray, SmoothMachine

POLES = (0.7, 0.7)


@dataclass(frozen=True)
class ObserverGains:
    """G1 (no unit) and G2 (Ohm), complex arrays of the speed's shape."""

    g1: ComplexArray
    g2: ComplexArray


def observer_gains(model: Coefficients, poles: tuple[complex, complex] = POLES) -> ObserverGains:
    """G1 = 1 + Phi - p1 - p2, G2 = (1 - p1)(1 - p2) / Gamma_e; poles in z, inside the unit circle.

    The error's polynomial is z^2 - (1 + Phi - G1) z + Phi - G1 + Gamma_e G2 (the thesis's (7.47) has two signs wrong).
    """
    p1, p2 = poles
    if not (abs(p1) < 1.0 and abs(p2) < 1.0):
        raise ValueError(f"poles = {poles}: must lie inside the unit circle")
    return ObserverGains(np.asarray(1.0 + model.phi - p1 - p2), np.asarray((1.0 - p1) * (1.0 - p2) / model.gamma_e))


@dataclass
class Observer:
    """The observer with its state: i (A), e (V), and the voltage of the sample before (V), in the estimated frame."""

    i: complex = 0j
    e: complex = 0j
    u: complex = 0j

    def step(self, model: Coefficients, chosen: ObserverGains, current: complex, voltage: complex) -> None:
        """From i[k] (A) and u[k] (V) to the prediction for k + 1."""
        error = current - self.i
        self.i = complex(
            model.phi * self.i
            + model.gamma1 * voltage
            + model.gamma2 * self.u
            + model.gamma_e * self.e
            + chosen.g1 * error
        )
        self.e = complex(self.e + chosen.g2 * error)
        self.u = voltage

    def turn(self, angle_rad: float) -> None:
        """The frame jumps by an angle: what is stored is seen from the new one."""
        factor = complex(math.cos(angle_rad), -math.sin(angle_rad))
        self.i, self.e, self.u = self.i * factor, self.e * factor, self.u * factor


def detected_angle(back_emf: complex, speed_sign: float) -> float:
    """Input of the phase-locked loop (rad): theta - theta^ near 0, -sgn(omega^) e_gamma / |e| (7.43); 0 without EMF."""
    size = abs(back_emf)
    return -math.copysign(1.0, speed_sign) * back_emf.real / size if size > 0.0 else 0.0


@dataclass(frozen=True)
class SteadyState:
    """Where observer and loop come to rest.

    error_deg: theta^ - theta (nan: the loop finds no angle); emf: estimated EMF (V, in the estimated frame).
    """

    error_deg: FloatArray
    emf: ComplexArray


def steady_state(
    machine: SmoothMachine, true: Coefficients, believed: Coefficients, omega: npt.ArrayLike, current: npt.ArrayLike
) -> SteadyState:
    """Rest of the observer at a current (A, in the estimated frame) that the regulator holds; arrays broadcast.

    The current's estimate is right in steady state, so that, with Gamma = Gamma1 + Gamma2 and primes for the believed,

        e^ = alpha e + beta i,  alpha = (Gamma_e / Gamma) (Gamma' / Gamma'_e)
        beta = [1 - Phi' - (Gamma' / Gamma)(1 - Phi)] / Gamma'_e

    e = j omega psi exp(-j error). The loop turns the frame until the real part of e^ is 0:

        error = arg(alpha) - asin(Re(beta i) / (|alpha| omega psi))
    """
    w, i = np.asarray(omega, dtype=np.float64), np.asarray(current, dtype=np.complex128)
    ratio = believed.gamma / true.gamma
    alpha = true.gamma_e * ratio / believed.gamma_e
    beta = (1.0 - believed.phi - ratio * (1.0 - true.phi)) / believed.gamma_e
    back = machine.psi_vs * w
    with np.errstate(invalid="ignore", divide="ignore"):
        error = np.angle(alpha) - np.arcsin((beta * i).real / (np.abs(alpha) * back))
    estimate = alpha * 1j * back * np.exp(-1j * error) + beta * i
    # The loop rests where the estimate points along sgn(omega) j.
    locked = estimate.imag * w > 0.0
    return SteadyState(np.asarray(np.degrees(np.where(locked, error, np.nan))), np.asarray(estimate))
