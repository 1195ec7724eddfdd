# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The machine as the firmware is told it: one value for all phases, from motor and inverter file."""

from __future__ import annotations

import math
from dataclasses import dataclass

from fluxlock.config.drive import MotorError
from fluxlock.config.inverter import Inverter
from fluxlock.config.motor import RPM_PER_RAD_S, Motor


@dataclass(frozen=True)
class Machine:
    """Means over the phases, with the wrong values that `drive.motor_error` asks for. SI units.

    saliency_h: L_q - L_d, of which inductance_h is the mean; psi_vs: peak flux of a phase.
    """

    motor: Motor
    winding_ohm: float
    switch_ohm: float
    inductance_h: float
    saliency_h: float
    psi_vs: float

    @staticmethod
    def of(motor: Motor, inverter: Inverter, error: MotorError | None = None) -> Machine:
        """Of a motor with the switches of an inverter."""
        error = error or MotorError()
        saliency_h = motor.inductance_q_h - motor.inductance_h[0] if motor.inductance_q_h else 0.0
        return Machine(
            motor=motor,
            winding_ohm=sum(motor.resistance_ohm) / 3 * error.resistance,
            switch_ohm=inverter.on_resistance_ohm,
            inductance_h=motor.mean_inductance_h * error.inductance,
            saliency_h=saliency_h * error.inductance,
            psi_vs=sum(motor.psi_vs) / 3 * error.flux,
        )

    @property
    def resistance_ohm(self) -> float:
        """Winding and switch."""
        return self.winding_ohm + self.switch_ohm

    @property
    def speed_max(self) -> float:
        """Highest mechanical speed, rad/s."""
        return self.motor.max_speed_rpm / RPM_PER_RAD_S

    # Vector control.
    @property
    def omega_max(self) -> float:
        """Highest electrical speed, rad/s."""
        return self.motor.pole_pairs * self.motor.max_speed_rpm / RPM_PER_RAD_S

    @property
    def fundamental_vs(self) -> float:
        """Fundamental of the flux."""
        return self.psi_vs * self.motor.emf_fundamental

    @property
    def torque_nm_per_a(self) -> float:
        """Torque over i_q."""
        return self.motor.phases / 2 * self.motor.pole_pairs * self.fundamental_vs

    # Six-step operation: two phases in series.
    @property
    def sinusoidal(self) -> bool:
        """Shape of the EMF."""
        return self.motor.emf == "sinusoidal"

    @property
    def k_e(self) -> float:
        """Mean line EMF of the conducting pair over mechanical speed, torque over current."""
        return self.motor.pole_pairs * self.psi_vs * (3.0 * math.sqrt(3.0) / math.pi if self.sinusoidal else 2.0)

    @property
    def line_emf_peak(self) -> float:
        """Peak line EMF over electrical speed."""
        return self.psi_vs * (math.sqrt(3.0) if self.sinusoidal else 2.0)

    @property
    def line_ohm(self) -> float:
        """Resistance of two phases."""
        return 2.0 * self.resistance_ohm

    @property
    def line_h(self) -> float:
        """Inductance of two phases."""
        return 2.0 * self.inductance_h

    @property
    def line_ohm_at_max_speed(self) -> float:
        """With the commutations: each costs L*I volt-seconds of the line, six times a turn, as a resistance does."""
        return self.line_ohm + 3.0 / math.pi * self.motor.pole_pairs * self.speed_max * self.inductance_h
