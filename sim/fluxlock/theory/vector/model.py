# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Exact discrete model of the machine with a voltage that is latched in the stationary frame, section 7.2.

    i[k+1] = Phi i[k] + Gamma1 u[k] + Gamma2 u[k-1] + Gamma_e e[k]      (7.16), (7.17)

i[k] is taken at k T_s; u[k] acts from k T_s + T_d to (k + 1) T_s + T_d. e = j omega psi is constant in the rotor's
frame. Subspace 3 of a five-phase machine is the same model at three times the speed, with its own L and psi.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import numpy.typing as npt

from fluxlock.config.motor import Motor
from fluxlock.results.rundata import FloatArray

ComplexArray = npt.NDArray[np.complex128]
Park = Literal["held", "exact"]
PARKS: tuple[Park, ...] = ("held", "exact")
TAYLOR_ORDER = 18  # at a norm of 1/2: below the rounding


@dataclass(frozen=True)
class SmoothMachine:
    """One subspace of a machine without saliency.

    r_ohm, l_h (self minus mutual), psi_vs (peak phase EMF over the subspace's own speed, V s/rad).
    """

    r_ohm: float
    l_h: float
    psi_vs: float

    def __post_init__(self) -> None:
        for name, least in (("r_ohm", 0.0), ("l_h", math.ulp(0.0)), ("psi_vs", 0.0)):
            value = getattr(self, name)
            if not least <= value < math.inf:
                raise ValueError(f"{name} = {value:g}: must be finite and {'above' if least else 'at least'} 0")

    @classmethod
    def from_motor(cls, motor: Motor) -> SmoothMachine:
        """Means of the phases of a motor file."""
        return cls(
            *(float(np.mean(values)) for values in (motor.resistance_ohm, motor.inductance_h, motor.psi_vs)),
        )

    def changed(self, r: float = 1.0, l: float = 1.0, psi: float = 1.0) -> SmoothMachine:  # noqa: E741
        """The machine with factors on its values."""
        return SmoothMachine(self.r_ohm * r, self.l_h * l, self.psi_vs * psi)


@dataclass(frozen=True)
class Sampling:
    """Sample period ts_s, delay td_s from the sample to the update (0..ts_s), and the angle of the inverse Park.

    held: u[k] is transformed with the angle of instant k. exact: with the rotor's angle in the middle of the time in
    which u[k] acts, omega (T_d + T_s / 2) later.
    """

    ts_s: float
    td_s: float
    park: Park = "held"

    def __post_init__(self) -> None:
        if not 0.0 < self.ts_s < math.inf:
            raise ValueError(f"ts_s = {self.ts_s:g}: must be finite and above 0")
        if not 0.0 <= self.td_s <= self.ts_s:
            raise ValueError(f"td_s = {self.td_s:g}: must be in 0 .. ts_s = {self.ts_s:g}")
        if self.park not in PARKS:
            raise ValueError(f"park = {self.park!r}: must be one of {', '.join(PARKS)}")

    @classmethod
    def at(cls, fs_hz: float, delay: float, park: Park = "held") -> Sampling:
        """From the sample frequency and the delay in sample periods (0..1)."""
        return cls(1.0 / fs_hz, delay / fs_hz, park)

    @property
    def delay(self) -> float:
        """T_d / T_s."""
        return self.td_s / self.ts_s

    def with_delay(self, delay: float) -> Sampling:
        """The same with another delay, in sample periods."""
        return replace(self, td_s=delay * self.ts_s)

    def lead_rad(self, omega: npt.ArrayLike) -> FloatArray:
        """What the inverse Park adds to the angle of the sample, at electrical speeds (rad/s)."""
        w = np.asarray(omega, dtype=np.float64)
        return np.asarray(w * (self.td_s + self.ts_s / 2) if self.park == "exact" else 0.0 * w)


@dataclass(frozen=True)
class Coefficients:
    """Phi (no unit), Gamma1, Gamma2, Gamma_e (1/Ohm): complex arrays of the speed's shape."""

    phi: ComplexArray
    gamma1: ComplexArray
    gamma2: ComplexArray
    gamma_e: ComplexArray

    @property
    def gamma(self) -> ComplexArray:
        """Gamma1 + Gamma2: what a constant voltage does in a sample."""
        return np.asarray(self.gamma1 + self.gamma2)


def _exprel(z: npt.NDArray[np.inexact]) -> npt.NDArray[np.inexact]:
    """(exp(z) - 1) / z, 1 at 0: the gain of an integration with decay, also without resistance or at standstill."""
    small = z == 0
    return np.asarray(np.where(small, 1.0, np.expm1(z) / np.where(small, 1.0, z)))


def coefficients(machine: SmoothMachine, omega: npt.ArrayLike, sampling: Sampling) -> Coefficients:
    """Phi, Gamma1, Gamma2, Gamma_e (7.17) at electrical speeds omega (rad/s, either sign, any shape)."""
    w = np.asarray(omega, dtype=np.float64)
    r, l_h, ts, td = machine.r_ohm, machine.l_h, sampling.ts_s, sampling.td_s
    turn = np.exp(-1j * w * ts)
    lead = np.exp(1j * sampling.lead_rad(w))
    decay = r / l_h
    new = (ts - td) / l_h * _exprel(np.asarray(-decay * (ts - td)))
    old = td / l_h * _exprel(np.asarray(-decay * td)) * math.exp(-decay * (ts - td))
    exponent = np.asarray(-(decay + 1j * w) * ts)
    return Coefficients(
        phi=np.asarray(np.exp(exponent)),
        gamma1=np.asarray(new * turn * lead, dtype=np.complex128),
        gamma2=np.asarray(old * turn * turn * lead, dtype=np.complex128),
        gamma_e=np.asarray(-ts / l_h * _exprel(exponent), dtype=np.complex128),
    )


def emf(machine: SmoothMachine, omega: npt.ArrayLike) -> ComplexArray:
    """EMF in the rotor's frame, j omega psi (V)."""
    return np.asarray(1j * np.asarray(omega, dtype=np.float64) * machine.psi_vs)


def steady_voltage(model: Coefficients, current: npt.ArrayLike, back_emf: npt.ArrayLike) -> ComplexArray:
    """Voltage (V) that holds a current (A) against an EMF (V), all in the rotor's frame."""
    i, e = np.asarray(current), np.asarray(back_emf)
    return np.asarray(((1.0 - model.phi) * i - model.gamma_e * e) / model.gamma)


@dataclass(frozen=True)
class SalientMachine:
    """r_ohm, l_d_h, l_q_h, psi_vs of a machine whose inductance depends on the axis."""

    r_ohm: float
    l_d_h: float
    l_q_h: float
    psi_vs: float


@dataclass(frozen=True)
class MatrixCoefficients:
    """The same model as 2 x 2 matrices on (d, q)."""

    phi: FloatArray
    gamma1: FloatArray
    gamma2: FloatArray
    gamma_e: FloatArray


def _expm(a: FloatArray) -> FloatArray:
    """Matrix exponential by scaling and squaring."""
    halvings = max(0, math.ceil(math.log2(max(float(np.abs(a).sum(axis=1).max()), 1e-300))) + 1)
    scaled = a / 2.0**halvings
    result = term = np.eye(a.shape[0])
    for order in range(1, TAYLOR_ORDER):
        term = term @ scaled / order
        result = result + term
    for _ in range(halvings):
        result = result @ result
    return np.asarray(result)


def _rotation(angle_rad: float) -> FloatArray:
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    return np.array([[c, -s], [s, c]])


def matrix_coefficients(machine: SalientMachine, omega: float, sampling: Sampling) -> MatrixCoefficients:
    """The model of a salient machine at one speed (rad/s).

    d/dt (i, u) = [[A, L^-1], [0, -omega J]] (i, u) in the rotor's frame: a latched voltage turns backwards in it.
    Gamma1 = M12(T_s - T_d) R(-omega T_d), Gamma2 = M11(T_s - T_d) M12(T_d) R(-omega T_s), M the exponential's blocks.
    """
    j = np.array([[0.0, -1.0], [1.0, 0.0]])
    inverse = np.diag([1.0 / machine.l_d_h, 1.0 / machine.l_q_h])
    inductance = np.diag([machine.l_d_h, machine.l_q_h])
    a = -inverse @ (machine.r_ohm * np.eye(2) + omega * j @ inductance)
    zero = np.zeros((2, 2))
    latched = np.block([[a, inverse], [zero, -omega * j]])
    constant = np.block([[a, -inverse], [zero, zero]])
    ts, td = sampling.ts_s, sampling.td_s
    new, old = _expm(latched * (ts - td)), _expm(latched * td)
    lead = _rotation(float(sampling.lead_rad(omega)))
    return MatrixCoefficients(
        phi=_expm(a * ts),
        gamma1=new[:2, 2:] @ _rotation(-omega * td) @ lead,
        gamma2=new[:2, :2] @ old[:2, 2:] @ _rotation(-omega * ts) @ lead,
        gamma_e=_expm(constant * ts)[:2, 2:],
    )
