# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Motors, inverters and drives to test with, as the files would state them: Motor-I but for the keys that are given."""

from __future__ import annotations

import math
from typing import Any

from fluxlock.config import Inverter, Load, Motor, Scenario
from fluxlock.config.drive import Drive
from fluxlock.config.inverter import Protection, Sensing
from fluxlock.config.scenario import Initial

_MOTOR = {
    "name": "Motor-I",
    "pole_pairs": 1,
    "resistance_ohm": 20e-3,
    "inductance_h": 22e-6,
    "psi_vs": 1e-3,
    "emf": "sinusoidal",
    "inertia_kgm2": 5e-7,
    "rated_current_a": 22.05,  # 20 A DC through two phases
    "max_speed_rpm": 100_000.0,
}
_INVERTER = {
    "name": "bench",
    "supply_v": 25.0,
    "on_resistance_ohm": 2e-3,
    "dead_time_s": 200e-9,
    "min_pulse_s": 400e-9,
    "sample_period_s": 1e-6,
    "voltage_full_scale_v": 30.0,
    "current_full_scale_a": 50.0,
    "divider_pole_s": 100e-9,
    "noise_lsb": 0.0,
    "phase_current_a": 45.0,
    "dc_current_a": 45.0,
}
_PARTS = {"sensing": Sensing, "protection": Protection}


def motor(**keys: Any) -> Motor:
    """A motor file."""
    return Motor.model_validate(_MOTOR | keys)


def inverter(**keys: Any) -> Inverter:
    """An inverter file; keys of its sensing and protection are given like the others."""
    table = _INVERTER | keys
    parts = {name: {k: table.pop(k) for k in part.model_fields if k in table} for name, part in _PARTS.items()}
    return Inverter.model_validate(table | parts)


def drive(**keys: Any) -> Drive:
    """The table [drive] of a scenario."""
    return Drive.model_validate({"carrier_hz": 40e3} | keys)


def scenario(
    motor: Motor, inverter: Inverter, drive: Drive, load: Load | None = None, theta_rad: float = 0.0, rpm: float = 0.0
) -> Scenario:
    """A run of them; limit and ramp that are left out are somewhat wider than those that the files stand for."""
    limit_a, accel_rpm_s = drive.current_limit_a, drive.accel_rpm_per_s
    if limit_a is None:
        limit_a = 1.2 * (motor.rated_current_a if drive.method == "vector" else motor.rated_dc_current_a)
    if accel_rpm_s is None:
        accel_rpm_s = 0.3 * motor.rated_torque_nm / motor.inertia_kgm2 * 30 / math.pi
    return Scenario(
        name="bench",
        motor=motor,
        inverter=inverter,
        drive=drive.model_copy(update={"current_limit_a": limit_a, "accel_rpm_per_s": accel_rpm_s}),
        load=load,
        initial=Initial(theta_deg=math.degrees(theta_rad) % 360.0, speed_rpm=rpm),
        duration_s=1.0,
    )
