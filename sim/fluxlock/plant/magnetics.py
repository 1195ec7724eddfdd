# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Flux linkages over the currents in rotor axes, for many currents at once: parameters of `flux.py`, checks.

The equations stand there. Currents and flux linkages are arrays [..., axes]: d, q and, with five phases, d3, q3.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from . import layout as L

if TYPE_CHECKING:
    from .params import MachineParams

FloatArray = npt.NDArray[np.float64]
PIECES_A_SIDE = (L.CROSS_PIECES - 2) // 2
RANGE = 2.0  # the pieces reach to so many times angle_current_a
CHECKED = 12.0  # currents of the check for a positive definite matrix, in multiples of the saturation's own
NODES, WEIGHTS = np.polynomial.legendre.leggauss(48)


class FluxMap:
    """Flux linkages, incremental inductances and energies of a machine of equal phases."""

    def __init__(self, machine: MachineParams) -> None:
        self.phases = machine.phases
        self.l_d = machine.l_h[0]
        self.l_q = machine.l_h[0] if machine.l_q_h is None else machine.l_q_h
        self.psi_1 = machine.psi_vs[0]
        third = machine.third
        self.l_d3, self.l_q3 = (third.l_d_h, third.l_q_h) if third else (0.0, 0.0)
        self.l_13, self.psi_3 = (third.mutual_h, third.psi_vs) if third else (0.0, 0.0)
        self.axes = 4 if third else 2
        self.saturation = machine.saturation
        self.sat_a, self.sat_b, self.sat_i = 0.0, 0.0, 1.0
        self.edges, self.cross = np.zeros(L.CROSS_PIECES), np.zeros((L.CROSS_PIECES, 5))
        if self.saturation:
            v = math.tanh(1.0)
            self.sat_i = self.saturation.current_a
            self.sat_a = (self.saturation.minus - self.saturation.plus) / (2.0 * v)
            self.sat_b = -(self.saturation.minus + self.saturation.plus) / (2.0 * v * v)
            self._make_cross()

    @property
    def l_zero(self) -> float:
        """Inductance of the zero sequence, taken: without shorted turns nothing depends on it."""
        return 0.5 * (self.l_d + self.l_q if self.phases == 3 else self.l_d3 + self.l_q3)

    def curve(self, i_q_a: float) -> tuple[float, float]:
        """L_dq (H) at i_d = 0 and its slope (H/A)."""
        assert self.saturation is not None
        most = self.saturation.angle_current_a
        at = min(max(i_q_a, -most), most)
        double = 2.0 * self.saturation.angle_at(at)
        half = 0.5 * (self.l_q - self.l_d)
        value = half * math.tan(double)
        slope = half * 2.0 * self.saturation.angle_slope_at(at) / math.cos(double) ** 2
        # Beyond the curve the slope falls to zero over as many amperes again.
        over = min(abs(i_q_a) - most, most) / most
        if over <= 0.0:
            return value, slope
        return value + math.copysign(most, i_q_a) * slope * (over - 0.5 * over * over), slope * (1.0 - over)

    def _make_cross(self) -> None:
        assert self.saturation is not None
        width = RANGE * self.saturation.angle_current_a / PIECES_A_SIDE
        knots = [width * (k - PIECES_A_SIDE) for k in range(2 * PIECES_A_SIDE + 1)]
        points = [self.curve(knot) for knot in knots]
        self.edges[0] = knots[0]
        self.edges[1:] = knots
        for k in range(2 * PIECES_A_SIDE):
            (p0, m0), (p1, m1) = points[k], points[k + 1]
            rise = (p1 - p0) / width
            third = (3.0 * rise - 2.0 * m0 - m1) / width
            fourth = (m0 + m1 - 2.0 * rise) / (width * width)
            self.cross[k + 1, 1:] = (p0, m0, third, fourth)
        self.cross[0, 1], self.cross[-1, 1] = points[0][0], points[-1][0]
        middle = PIECES_A_SIDE + 1  # the piece that begins at i_q = 0
        for k in range(middle, L.CROSS_PIECES - 1):
            self.cross[k + 1, 0] = self.cross[k, 0] + self._piece_integral(k, width)
        for k in range(middle - 1, 0, -1):
            self.cross[k, 0] = self.cross[k + 1, 0] - self._piece_integral(k, width)
        self.cross[0, 0] = self.cross[1, 0]

    def _piece_integral(self, k: int, y: float) -> float:
        _, c0, c1, c2, c3 = self.cross[k]
        return float(y * (c0 + y * (c1 / 2.0 + y * (c2 / 3.0 + y * c3 / 4.0))))

    def cross_at(self, i_q: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Integral of L_dq over i_q, L_dq at i_d = 0, and its slope."""
        k = np.clip(np.searchsorted(self.edges[1:], i_q, side="right"), 0, L.CROSS_PIECES - 1)
        y = i_q - self.edges[k]
        f, c0, c1, c2, c3 = np.moveaxis(self.cross[k], -1, 0)
        integral = f + y * (c0 + y * (c1 / 2.0 + y * (c2 / 3.0 + y * c3 / 4.0)))
        return integral, c0 + y * (c1 + y * (c2 + y * c3)), c1 + y * (2.0 * c2 + y * 3.0 * c3)

    def flux(self, i: npt.ArrayLike) -> FloatArray:
        """Flux linkages (V s) of currents (A)."""
        i = np.asarray(i, float)
        d, q = i[..., 0], i[..., 1]
        out = np.empty_like(i)
        integral, l_dq, _ = self.cross_at(q)
        u = d / self.sat_i
        v = np.tanh(u)
        log_cosh = np.logaddexp(u, -u) - math.log(2.0)
        bend = self.sat_i * (self.sat_a * log_cosh + self.sat_b * (u - v))
        out[..., 0] = self.psi_1 + self.l_d * (d - bend) + (1.0 - v * v) * integral
        out[..., 1] = self.l_q * q + self.sat_i * v * l_dq
        if self.axes == 4:
            out[..., 0] += self.l_13 * i[..., 2]
            out[..., 1] += self.l_13 * i[..., 3]
            out[..., 2] = self.psi_3 + self.l_d3 * i[..., 2] + self.l_13 * d
            out[..., 3] = self.l_q3 * i[..., 3] + self.l_13 * q
        return out

    def inductance(self, i: npt.ArrayLike) -> FloatArray:
        """Incremental inductances (H), a symmetric matrix [..., axes, axes]."""
        i = np.asarray(i, float)
        d, q = i[..., 0], i[..., 1]
        integral, l_dq, slope = self.cross_at(q)
        v = np.tanh(d / self.sat_i)
        rest = 1.0 - v * v
        out = np.zeros((*i.shape, self.axes))
        out[..., 0, 0] = self.l_d * (1.0 - v * (self.sat_a + self.sat_b * v)) - 2.0 / self.sat_i * v * rest * integral
        out[..., 0, 1] = out[..., 1, 0] = rest * l_dq
        out[..., 1, 1] = self.l_q + self.sat_i * v * slope
        if self.axes == 4:
            out[..., 2, 2], out[..., 3, 3] = self.l_d3, self.l_q3
            for x, y in ((0, 2), (1, 3)):
                out[..., x, y] = out[..., y, x] = self.l_13
        return out

    def energy(self, i: npt.ArrayLike) -> float:
        """Magnetic energy (J) above that at no current."""
        i = np.asarray(i, float)
        d, q = float(i[0]), float(i[1])
        integral, l_dq, _ = (float(x) for x in self.cross_at(np.asarray(q)))
        v = math.tanh(d / self.sat_i)
        # Flux linkage times current less co-energy, for the product D(i_d) F(i_q).
        crossed = (1.0 - v * v) * integral * d + self.sat_i * v * (l_dq * q - integral)
        x = 0.5 * (NODES + 1.0) * d
        on_way = np.tanh(x / self.sat_i)
        own = self.l_d * 0.5 * d * float(WEIGHTS @ (x * (1.0 - on_way * (self.sat_a + self.sat_b * on_way))))
        total = own + 0.5 * self.l_q * q * q + crossed
        if self.axes == 4:
            total += 0.5 * (self.l_d3 * i[2] ** 2 + self.l_q3 * i[3] ** 2) + self.l_13 * (d * i[2] + q * i[3])
        return float(0.5 * self.phases * total)

    def least_inductance_h(self) -> float:
        """Smallest eigenvalue of the incremental inductances over all currents."""
        axis: FloatArray = np.zeros(1)
        other = axis
        if self.saturation:
            axis = np.linspace(-CHECKED, CHECKED, 97) * self.saturation.current_a
            other = np.linspace(-RANGE, RANGE, 161) * self.saturation.angle_current_a
        d, q = np.meshgrid(axis, other)
        i = np.zeros((*d.shape, self.axes))
        i[..., 0], i[..., 1] = d, q
        return float(np.linalg.eigvalsh(self.inductance(i)).min())


def rotor_axes(theta: float, phases: int, of_phases: npt.ArrayLike) -> FloatArray:
    """Phase values in rotor axes d, q(, d3, q3) at an electrical angle (rad); amplitude-invariant."""
    return np.asarray(2.0 / phases * axes_matrix(theta, phases) @ np.asarray(of_phases, float))


def axes_matrix(theta: float, phases: int) -> FloatArray:
    """Rows d, q(, d3, q3): share of each axis in the phases."""
    x = np.arange(phases)
    rows: list[Any] = []
    for h in (1, 3)[: phases // 2]:
        angle = h * (theta - 2.0 * np.pi / phases * x)
        rows += [np.cos(angle), -np.sin(angle)]
    return np.array(rows)
