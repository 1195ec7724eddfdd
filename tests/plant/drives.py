# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A plain six-step drive for the tests: Motor-I of the specification, commutated by its true angle."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

from fluxlock.plant import (
    InverterParams,
    MachineParams,
    MechanicsParams,
    Plant,
    PlantParams,
    RecordingParams,
    SensingParams,
)

CLOCK_S = 20e-9
PAIRS = ((0, 1), (0, 2), (1, 2), (1, 0), (2, 0), (2, 1))
STROBE_CYCLES = 50
CARRIER_CYCLES = 1250


def motor_1(**changes: Any) -> PlantParams:
    """Motor-I; changes as section__field=value."""
    params = PlantParams(
        MachineParams(1, (0.02,) * 3, (22e-6,) * 3, (1e-3,) * 3),
        InverterParams(25.0, r_on_ohm=5e-3, supply_r_ohm=0.02),
        SensingParams(30.0, 50.0, divider_pole_s=100e-9),
        MechanicsParams(5e-7, omega_m_rad_s=6283.0, fan_nm_s2_per_rad2=5.07e-10),
        RecordingParams(),
        CLOCK_S,
    )
    for key, value in changes.items():
        section, _, name = key.partition("__")
        part = dataclasses.replace(getattr(params, section), **{name: value})
        params = dataclasses.replace(params, **{section: part})
    return params


def six_step_gates(plant: Plant, t_cycle: int, duty: float) -> int:
    """Gates of the sector the rotor is in; the upper switch chops."""
    prime = (math.degrees(plant.theta_e_rad) + 180.0) % 360.0
    high, low = PAIRS[int(((prime - 30.0) % 360.0) // 60.0)]
    on = t_cycle % CARRIER_CYCLES < duty * CARRIER_CYCLES
    return (1 << (2 * high) if on else 0) | 2 << (2 * low)


def drive(plant: Plant, strobes: int, duty: float = 0.6) -> None:
    """Run on with a sample set each microsecond; gates change at strobes only."""
    first = plant.t_cycle // STROBE_CYCLES + 1
    for k in range(first, first + strobes):
        t = k * STROBE_CYCLES
        plant.step(t, six_step_gates(plant, t, duty), 1)
        if k % 10_000 == 0:
            plant.drain()
