# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What is known of a machine before it is measured: its name plate, and first numbers for the parameter block."""

from __future__ import annotations

import math
from dataclasses import dataclass

from fluxlock.config.inverter import Inverter
from fluxlock.config.motor import RPM_PER_RAD_S, Motor

# First numbers, of the impedance and the EMF that a machine for this supply, current and speed would have. They are in
# the parameter block because it must have some; the commissioning program reads none of them.
RESISTANCE_SHARE, REACTANCE_SHARE, EMF_SHARE = 0.05, 0.2, 0.8
START_S = 0.5  # rated torque to the highest speed


@dataclass(frozen=True)
class NamePlate:
    """Name, pole pairs, rated amplitude of the phase currents (A), highest speed (r/min)."""

    name: str
    pole_pairs: int
    rated_current_a: float
    max_speed_rpm: float

    @property
    def omega_max(self) -> float:
        """Highest electrical speed (rad/s)."""
        return self.max_speed_rpm / RPM_PER_RAD_S * self.pole_pairs


def first_guess(plate: NamePlate, inverter: Inverter) -> Motor:
    """A machine like the one that has this name plate."""
    phase_v = inverter.supply_v / math.sqrt(3)
    impedance = phase_v / plate.rated_current_a
    psi = EMF_SHARE * phase_v / plate.omega_max
    torque = 1.5 * plate.pole_pairs * psi * plate.rated_current_a
    return Motor(
        name=plate.name,
        pole_pairs=plate.pole_pairs,
        resistance_ohm=(RESISTANCE_SHARE * impedance,) * 3,
        inductance_h=(REACTANCE_SHARE * impedance / plate.omega_max,) * 3,
        psi_vs=(psi,) * 3,
        emf="sinusoidal",
        inertia_kgm2=torque * START_S / (plate.omega_max / plate.pole_pairs),
        rated_current_a=plate.rated_current_a,
        max_speed_rpm=plate.max_speed_rpm,
    )
