# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Current controllers A, B and C, section 7.3, as one recurrence with complex gains.

    u[k] = limit(u[k-1] + g eps[k] - h eps[k-1]),  eps = i* - i, G(z) = (g z - h) / (z - 1)

A: complex vector PI, backward Euler, k_p = omega_n L, k_i = omega_n (R + j omega L): g = k_p + k_i T_s, h = k_p.
B: g = gamma (1 - T_d/T_s) / Gamma1 (T_d = T_s: gamma / Gamma2), h = g Phi.
C: g = gamma / (Gamma1 + Gamma2), h = g Phi, (7.30).
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from fluxlock.results.rundata import IntArray
from fluxlock.theory.vector.model import Coefficients, ComplexArray, Sampling, SmoothMachine, coefficients

Kind = Literal["A", "B", "C"]
KINDS: tuple[Kind, ...] = ("A", "B", "C")
GAMMA = 0.35
BANDWIDTH_HZ = 800.0  # omega_n of controller A
SETTLED = 0.05


@dataclass(frozen=True)
class Gains:
    """g and h of the recurrence (V/A)."""

    g: complex
    h: complex

    def turned(self, angle_rad: float) -> Gains:
        """Both turned: the same loop if the inverse Park's angle is moved by the opposite."""
        factor = cmath.exp(1j * angle_rad)
        return Gains(self.g * factor, self.h * factor)


def gains(
    kind: Kind,
    machine: SmoothMachine,
    omega: float,
    sampling: Sampling,
    *,
    gamma: float = GAMMA,
    bandwidth_hz: float = BANDWIDTH_HZ,
) -> Gains:
    """Gains at an electrical speed (rad/s, signed).

    gamma (0..1, no unit) is that of B and C, bandwidth_hz that of A. A knows no delay, so that its gains do not depend
    on the inverse Park; B and C contain it.
    """
    model = coefficients(machine, omega, sampling)
    if kind == "A":
        omega_n = 2.0 * math.pi * bandwidth_hz
        k_p = omega_n * machine.l_h
        k_i = omega_n * complex(machine.r_ohm, omega * machine.l_h)
        return Gains(k_p + k_i * sampling.ts_s, complex(k_p))
    if kind == "C":
        g = gamma / complex(model.gamma)
    elif sampling.td_s < sampling.ts_s:
        g = gamma * (1.0 - sampling.delay) / complex(model.gamma1)
    else:
        g = gamma / complex(model.gamma2)
    return Gains(g, g * complex(model.phi))


@dataclass
class Regulator:
    """The recurrence with its state (u in V, error in A).

    u_max: circle that binds u (V); the bound voltage is the state, so that no integral grows. Without `conditioned` the
    remembered error is the true one: then it does not belong to the bound voltage, the zero no longer cancels the
    plant's pole, and what is left after a limit fades with Phi. With it, the error is remembered that would have led
    to the bound voltage, eps + (u_bound - u) / g, and the loop goes on as if it had never been bound.
    """

    gains: Gains
    u_max: float = math.inf
    conditioned: bool = False
    u: complex = 0j
    error: complex = 0j

    def step(self, error: complex) -> complex:
        """Next voltage (V) for a current error (A)."""
        u = self.u + self.gains.g * error - self.gains.h * self.error
        size = abs(u)
        self.u = u if size <= self.u_max else u * (self.u_max / size)
        self.error = error + (self.u - u) / self.gains.g if self.conditioned else error
        return self.u


def step_response(model: Coefficients, chosen: Gains, samples: int, *, step: complex = 1.0) -> ComplexArray:
    """Current (A) at the samples 0 .. samples - 1 after a step of the reference at sample 0, from rest, without EMF.

    The loop is linear, so that this adds to whatever flows before.
    """
    return follow(model, Regulator(chosen), np.full(samples, step, dtype=np.complex128))


def follow(model: Coefficients, regulator: Regulator, reference: ComplexArray, back_emf: complex = 0j) -> ComplexArray:
    """Current (A) at the samples of a reference (A) against an EMF (V), from rest: no current, u cancels the EMF."""
    phi, gamma1, gamma2 = complex(model.phi), complex(model.gamma1), complex(model.gamma2)
    push = complex(model.gamma_e) * back_emf
    current, before = 0j, -push / complex(model.gamma)
    regulator.u = before
    found = np.empty(reference.size, dtype=np.complex128)
    for k, wanted in enumerate(reference):
        found[k] = current
        u = regulator.step(complex(wanted) - current)
        current = phi * current + gamma1 * u + gamma2 * before + push
        before = u
    return found


def cross_peak(response: ComplexArray, step: complex = 1.0) -> float:
    """Largest current across the step's direction, over the step."""
    return float(np.abs((response / step).imag).max())


def settling_samples(response: ComplexArray, step: complex = 1.0, band: float = SETTLED) -> int:
    """Samples until the current vector stays within a band (part of the step) around the reference."""
    outside: IntArray = np.flatnonzero(np.abs(response / step - 1.0) > band)
    if outside.size and outside[-1] == response.size - 1:
        raise ValueError(f"not settled to {band:g} of the step within {response.size} samples; follow it longer")
    return int(outside[-1]) + 1 if outside.size else 0
