# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The machine as the theory sees it: three equal phases, taken from a motor file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from fluxlock.config.motor import RPM_PER_RAD_S, Motor
from fluxlock.results.rundata import FloatArray


@dataclass(frozen=True)
class Machine:
    """Means of the phases.

    r_ohm, l_h (self minus mutual), psi_vs (peak phase EMF over electrical speed, V s/rad), line_flux_vs (mean line EMF
    of a sector over electrical speed), flat_top_deg (of a trapezoid).
    """

    name: str
    pole_pairs: int
    r_ohm: float
    l_h: float
    psi_vs: float
    line_flux_vs: float
    emf: Literal["sinusoidal", "trapezoidal"] = "sinusoidal"
    flat_top_deg: float = 120.0

    @classmethod
    def from_motor(cls, motor: Motor) -> Machine:
        """The machine of a motor file."""
        return cls(
            name=motor.name,
            pole_pairs=motor.pole_pairs,
            r_ohm=sum(motor.resistance_ohm) / 3,
            l_h=motor.mean_inductance_h,
            psi_vs=sum(motor.psi_vs) / 3,
            line_flux_vs=motor.line_flux_vs,
            emf=motor.emf,
            flat_top_deg=motor.flat_top_deg,
        )

    def omega_e(self, speed_rpm: npt.ArrayLike) -> FloatArray:
        """Electrical speed (rad/s) at mechanical speeds (r/min)."""
        return np.asarray(speed_rpm, dtype=np.float64) / RPM_PER_RAD_S * self.pole_pairs

    def carriers_per_sector(self, speed_rpm: npt.ArrayLike, carrier_hz: float) -> FloatArray:
        """N of (5.2)."""
        return np.asarray(carrier_hz * 2.0 * np.pi / (6.0 * self.omega_e(speed_rpm)))

    def emf_shape(self, angle_deg: npt.ArrayLike) -> FloatArray:
        """Phase EMF over psi * omega at the phase's own angle theta'; rises through 0 at 0 degrees."""
        angle = np.asarray(angle_deg, dtype=np.float64)
        if self.emf == "sinusoidal":
            return np.asarray(np.sin(np.radians(angle)))
        ramp = (180.0 - self.flat_top_deg) / 2
        # Distance from the nearest rising zero, folded at the quarter turn.
        from_zero = 90.0 - np.abs((angle - 90.0) % 360.0 - 180.0)
        return np.asarray(-np.clip(from_zero / ramp, -1.0, 1.0))

    def steady_duty(self, supply_v: float, omega: npt.ArrayLike, current_a: npt.ArrayLike) -> FloatArray:
        """Duty of the periodic state at a current; above 1: out of reach.

        Volt-seconds of a sector: line EMF, resistive drop, and L * current because the incoming phase starts from
        zero: M Vdc = line_flux w + 2 R i + 6 f_e L i. At 90 000 r/min and 32 A the last term is a quarter of Vdc.
        """
        w = np.asarray(omega, dtype=np.float64)
        drop = 2.0 * self.r_ohm + 6.0 * w / (2.0 * np.pi) * self.l_h
        return np.asarray((self.line_flux_vs * w + drop * np.asarray(current_a, dtype=np.float64)) / supply_v)
