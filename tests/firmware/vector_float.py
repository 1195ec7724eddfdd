# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Machine in dq and its regulators in floating point: the independent side of the vector firmware's tests.

Equations of Yang 2020, chapter 7; SI units, angles in radians, complex numbers d + jq.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass

from fluxlock.clock import CLOCK_HZ
from fluxlock.firmware.vector_formats import vector_machine
from fluxlock.headers import CData

HELD, EXACT = "held", "exact"
A, B, C = "ABC"
GAMMA = 0.35
BANDWIDTH = 2 * math.pi * 800.0  # of regulator A, rad/s


@dataclass(frozen=True)
class Subspace:
    """R, L and psi of one subspace, full scales of its currents and voltages, sample period and delay."""

    resistance_ohm: float = 0.020
    inductance_h: float = 22e-6
    psi_vs: float = 1e-3
    full_scale_a: float = 50.0
    full_scale_v: float = 30.0
    period_cycles: int = 3333  # 15 kHz
    delay: float = 0.5  # T_d / T_s
    harmonic: int = 1
    park: str = HELD

    @property
    def period_s(self) -> float:
        """T_s."""
        return self.period_cycles / CLOCK_HZ

    def machine(self) -> CData:
        """The same in the units of the firmware, vector_machine_t."""
        per_second = self.resistance_ohm / self.inductance_h
        admittance = self.period_s * self.full_scale_v / (self.inductance_h * self.full_scale_a)
        resistance = per_second * self.period_s
        return vector_machine(resistance, self.delay, admittance, self.period_cycles, self.park, self.harmonic)

    def speed_turn_q36(self, turns_per_period: float) -> int:
        """Electrical speed of the rotor for so many turns (of subspace 1) in a sample period."""
        return round(turns_per_period / self.period_cycles * 2**36)

    def omega(self, speed_turn_q36: int) -> float:
        """Angular frequency of this subspace, rad/s."""
        return 2 * math.pi * speed_turn_q36 / 2**36 * CLOCK_HZ * self.harmonic


@dataclass(frozen=True)
class FloatModel:
    """Phi, Gamma1, Gamma2, Gamma_e (A/V) at one speed."""

    phi: complex
    gamma1: complex
    gamma2: complex
    gamma_e: complex

    def step(self, i: complex, u: complex, u_before: complex, e: complex) -> complex:
        """Current a sample later."""
        return self.phi * i + self.gamma1 * u + self.gamma2 * u_before + self.gamma_e * e


def float_model(m: Subspace, omega: float) -> FloatModel:
    """The exact discrete model at omega (rad/s, of the subspace)."""
    r, rate, ts, td = m.resistance_ohm, m.resistance_ohm / m.inductance_h, m.period_s, m.delay * m.period_s
    phi = cmath.exp(-(rate + 1j * omega) * ts)
    lead = cmath.exp(1j * omega * (td + ts / 2)) if m.park == EXACT else 1.0
    gamma1 = cmath.exp(-1j * omega * ts) * -math.expm1(-rate * (ts - td)) / r * lead
    gamma2 = cmath.exp(-2j * omega * ts) * math.exp(-rate * (ts - td)) * -math.expm1(-rate * td) / r * lead
    return FloatModel(phi, gamma1, gamma2, (phi - 1) / (r + 1j * omega * m.inductance_h))


def float_gains(m: Subspace, order: str, omega: float) -> tuple[complex, complex]:
    """Coefficients g and h of regulator A, B or C, V/A."""
    model = float_model(m, omega)
    if order == A:
        k_p = BANDWIDTH * m.inductance_h
        return k_p + BANDWIDTH * (m.resistance_ohm + 1j * omega * m.inductance_h) * m.period_s, k_p
    if order == C:
        g = GAMMA / (model.gamma1 + model.gamma2)
    elif m.delay == 1.0:
        g = GAMMA / model.gamma2
    else:
        g = GAMMA * (1 - m.delay) / model.gamma1
    return g, g * model.phi
