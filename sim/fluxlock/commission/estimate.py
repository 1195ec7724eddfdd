# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Numbers of a machine from what was measured: docs/theory/identify.md. SI units, electrical angles and speeds."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fluxlock.commission.protocol import Block, MeasurementError

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

POINTS = 24  # in a block, where the dead time is evaluated
FRICTION = ("coulomb_nm", "viscous_nm_s_per_rad", "fan_nm_s2_per_rad2")


@dataclass(frozen=True)
class Line:
    """u = slope i + intercept along one phase axis, with the points that it was put through."""

    current_a: tuple[float, ...]
    voltage_v: tuple[float, ...]
    slope_ohm: float
    intercept_v: float

    @staticmethod
    def through(points: Sequence[Block]) -> Line:
        """Least squares."""
        i = np.array([b.current_a.real for b in points])
        u = np.array([b.voltage_v.real for b in points])
        slope, intercept = np.polyfit(i, u, 1)
        return Line(tuple(i), tuple(u), float(slope), float(intercept))


def phase_resistances(slopes: Sequence[float]) -> tuple[float, float, float]:
    """Phase resistances from the slopes along the axes of A, B and C.

    With current i along A, -i/2 flows in B and in C: slope_A = R_A/2 + (R_A + R_B + R_C)/6.
    """
    a, b, c = (2.0 * s - sum(slopes) / 3.0 for s in slopes)
    return a, b, c


def triangle_inductance(voltage_v: float, corner_a: float, resistance_ohm: float, half_s: float) -> float:
    """L of a current that the voltage +-U drives to +-corner in half periods: corner = U/R tanh(half R / 2 L)."""
    share = corner_a * resistance_ohm / voltage_v
    if not 0.0 < share < 1.0:
        raise MeasurementError(
            f"the current answers {voltage_v:.3g} V of alternating voltage with {corner_a:.3g} A, "
            "which no inductance explains; is the motor connected?"
        )
    return half_s * resistance_ohm / (2.0 * math.atanh(share))


@dataclass(frozen=True)
class Winding:
    """What the EMF is found with. dead_v: what a leg loses by its dead time and diode."""

    resistance_ohm: float
    ld_h: float
    lq_h: float
    dead_v: float

    @property
    def saliency_h(self) -> float:
        """L_d - L_q."""
        return self.ld_h - self.lq_h


@dataclass(frozen=True)
class Motion:
    """Rotor against frame, block by block: emf of the active flux, its angle, speeds, torque over pole pairs."""

    time_s: FloatArray
    emf_v: ComplexArray
    current_a: ComplexArray
    frame_omega: FloatArray
    delta: FloatArray  # d axis ahead of the frame's

    @property
    def omega(self) -> FloatArray:
        """Electrical speed of the rotor, in the middle of the blocks."""
        return self.frame_omega + np.gradient(self.delta, self.time_s)

    @property
    def rotor_current_a(self) -> ComplexArray:
        """Current in the rotor's frame."""
        return np.asarray(self.current_a * np.exp(-1j * self.delta))

    def magnet_emf_v(self, w: Winding) -> FloatArray:
        """|EMF| less what the saliency adds to it with the current on d."""
        return np.asarray(np.abs(self.emf_v) - w.saliency_h * self.rotor_current_a.real * np.abs(self.omega))

    def above(self, least_omega: float) -> Motion:
        """The part in which the frame is that fast."""
        k = np.flatnonzero(np.abs(self.frame_omega) >= least_omega)
        return Motion(self.time_s[k], self.emf_v[k], self.current_a[k], self.frame_omega[k], self.delta[k])


def emf(blocks: Sequence[Block], before: Block, w: Winding, dead: FloatArray | ComplexArray) -> ComplexArray:
    """EMF u - R i - L_q (di/dt + j omega i): with L_q that of the active flux psi + (L_d - L_q) i_d.

    before: the block before the first. dead: voltage lost, of every block.
    """
    i = np.array([b.current_a for b in blocks])
    u = np.array([b.voltage_v for b in blocks])
    t = np.array([b.duration_s for b in blocks])
    ends = np.array([before.last_a, *(b.last_a for b in blocks)])
    inductive = w.lq_h * (np.diff(ends) / t + 1j * frame_omega(blocks, before) * i)
    return np.asarray(u - dead - w.resistance_ohm * i - inductive)


def frame_omega(blocks: Sequence[Block], before: Block) -> FloatArray:
    """Mean speed of the frame in each block."""
    ends = np.array([before.omega, *(b.omega for b in blocks)])
    return np.asarray((ends[1:] + ends[:-1]) / 2)


def lost_voltage(current_a: complex, angles: FloatArray, dead_v: float) -> complex:
    """Mean of what the dead time takes, in a frame at these angles in which the current is constant.

    Every leg loses dead_v in the direction of its current.
    """
    lost = np.zeros(len(angles), np.complex128)
    for k in range(3):
        axis = np.exp(1j * (2.0 * math.pi * k / 3 - angles))
        lost += 2.0 / 3.0 * dead_v * np.sign((current_a * np.conj(axis)).real) * axis
    return complex(lost.mean())


def turning(blocks: Sequence[Block], before: Block, w: Winding) -> Motion:
    """Motion in a frame that turns: the EMF is that of omega psi."""
    omega = frame_omega(blocks, before)
    t = np.array([b.duration_s for b in blocks])
    ends = np.array([b.angle for b in blocks])
    inside = (np.arange(POINTS) + 0.5) / POINTS
    i = np.array([b.current_a for b in blocks])
    dead = [lost_voltage(i[k], ends[k] - omega[k] * t[k] * inside, w.dead_v) for k in range(len(blocks))]
    e = emf(blocks, before, w, np.array(dead))
    return Motion(np.cumsum(t), e, i, omega, np.unwrap(np.angle(e / 1j * np.sign(omega))))


def falling(blocks: Sequence[Block], before: Block, w: Winding, from_deg: float) -> tuple[Motion, float]:
    """Motion of a rotor that swings to the axis of a frame at rest, beginning at an angle, and the flux (V s/rad).

    The linkage passed on the way is psi (1 - exp(j from)).
    """
    t = np.array([b.duration_s for b in blocks])
    e = emf(blocks, before, w, 4.0 / 3.0 * w.dead_v * np.ones(len(blocks)))
    linkage = np.cumsum(e * t) - e * t / 2
    way = complex(np.sum(e * t))
    psi = abs(way / (1.0 - np.exp(1j * math.radians(from_deg))))
    delta = np.unwrap(np.angle(1.0 + (linkage - way) / psi))
    i = np.array([b.current_a for b in blocks])
    return Motion(np.cumsum(t), e, i, np.zeros(len(blocks)), delta), psi


def flux(runs: Sequence[Motion], w: Winding) -> float:
    """psi: the EMF of the active flux over the speed, less (L_d - L_q) i_d."""
    omega = np.concatenate([run.omega for run in runs])
    size = np.concatenate([np.abs(run.emf_v) for run in runs])
    i_d = np.concatenate([run.rotor_current_a.real for run in runs])
    active = float(np.sum(size * np.abs(omega)) / np.sum(omega**2))
    return active - w.saliency_h * float(np.mean(i_d))


@dataclass(frozen=True)
class Mechanics:
    """J dw/dt = T - coulomb - viscous w - fan w^2, w mechanical and positive. time, speed, torque: of the fit."""

    inertia_kgm2: float
    coulomb_nm: float
    viscous_nm_s_per_rad: float
    fan_nm_s2_per_rad2: float
    time_s: FloatArray
    omega_m: FloatArray
    torque_nm: FloatArray

    def friction_nm(self, omega_m: FloatArray) -> FloatArray:
        """Torque of the friction at positive speeds."""
        return np.asarray(self.coulomb_nm + self.viscous_nm_s_per_rad * omega_m + self.fan_nm_s2_per_rad2 * omega_m**2)


def mechanics(runs: Sequence[Motion], w: Winding, psi: float, pole_pairs: int) -> Mechanics:
    """Inertia and friction from integrals: J w(t) + sum of the frictions' integrals = integral of T.

    Each run has a start of its own. Frictions are not negative: the best of the combinations of them that fulfil it.
    """
    columns: list[FloatArray] = []
    right: list[FloatArray] = []
    times: list[FloatArray] = []
    speeds: list[FloatArray] = []
    torques: list[FloatArray] = []
    for k, run in enumerate(runs):
        step = np.diff(run.time_s)
        i = run.rotor_current_a
        torque = 1.5 * pole_pairs * (psi + w.saliency_h * i.real) * i.imag
        # Speeds between the blocks' middles, integrals to there.
        omega = (run.frame_omega[1:] + run.frame_omega[:-1]) / 2 + np.diff(run.delta) / step
        omega_m = omega / pole_pairs
        middle = np.concatenate(([omega_m[0]], (omega_m[1:] + omega_m[:-1]) / 2, [omega_m[-1]]))
        width = np.concatenate((step, step[-1:]))

        def integral(values: FloatArray, width: FloatArray = width) -> FloatArray:
            return np.asarray(np.cumsum(values * width)[:-1])

        own = [np.zeros(len(omega_m)) for _ in runs]
        own[k] = np.ones(len(omega_m))
        parts = [omega_m, integral(np.sign(middle)), integral(middle), integral(middle * np.abs(middle)), *own]
        columns.append(np.stack(parts, axis=1))
        right.append(integral(torque))
        times.append(run.time_s + (times[-1][-1] if times else 0.0))
        speeds.append(middle)
        torques.append(torque)
    a, b = np.concatenate(columns), np.concatenate(right)
    size = np.maximum(np.linalg.norm(a, axis=0), 1e-300)
    best: tuple[float, FloatArray] | None = None
    for count in range(len(FRICTION) + 1):
        for chosen in itertools.combinations(range(1, 1 + len(FRICTION)), count):
            used = [0, *chosen, *range(1 + len(FRICTION), a.shape[1])]
            x = np.zeros(a.shape[1])
            x[used] = np.linalg.lstsq(a[:, used] / size[used], b, rcond=None)[0] / size[used]
            rest = float(np.sum((a @ x - b) ** 2))
            if np.all(x[: 1 + len(FRICTION)] >= 0.0) and (best is None or rest < best[0]):
                best = rest, x
    if best is None or best[1][0] <= 0.0:
        raise MeasurementError("the rotor does not follow its torque: is it blocked, or driven by its load?")
    x = best[1]
    return Mechanics(
        float(x[0]),
        float(x[1]),
        float(x[2]),
        float(x[3]),
        np.concatenate(times),
        np.concatenate(speeds),
        np.concatenate(torques),
    )
