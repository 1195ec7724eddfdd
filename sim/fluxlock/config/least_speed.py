# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The least speed that a machine holds without a sensor, by rule from its file."""

from __future__ import annotations

import math

from fluxlock.config.inverter import Inverter
from fluxlock.config.motor import RPM_PER_RAD_S, Motor

# Vector control is blind where R I, of which the file may be wrong by this share, exceeds this share of the EMF.
RESISTANCE_IN_DOUBT, BLIND_SHARE = 0.5, 0.45


def least_six_step_rpm(motor: Motor) -> float:
    """Slowest speed at which a sector does not outlast the mechanical time constant (r/min).

    That is the time from rest to the highest speed at rated torque: between two crossings nothing is measured.
    """
    run_up_s = motor.inertia_kgm2 * motor.max_speed_rpm / RPM_PER_RAD_S / motor.rated_torque_nm
    return 60.0 / (6 * run_up_s * motor.pole_pairs)


def least_vector_rpm(motor: Motor, inverter: Inverter | None = None) -> float:
    """Slowest speed at which rated current does not hide the EMF (r/min)."""
    ohm = sum(motor.resistance_ohm) / 3 + (inverter.on_resistance_ohm if inverter else 0.0)
    flux_vs = sum(motor.psi_vs) / 3 * motor.emf_fundamental
    omega = RESISTANCE_IN_DOUBT * ohm * motor.rated_current_a / (BLIND_SHARE * flux_vs)
    return omega / (2 * math.pi) * 60.0 / motor.pole_pairs
