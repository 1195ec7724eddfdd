# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The chip with five phases under a script: registers that every run needs, and the plant."""

from __future__ import annotations

from fluxlock.clock import CLOCK_HZ
from fluxlock.config import Inverter, Motor
from fluxlock.config.motor import machine_params
from fluxlock.cosim.convert import inverter_params, sensing_params
from fluxlock.cosim.program import Row, wait
from fluxlock.plant import MechanicsParams, PlantParams, RecordingParams

PHASES = 5
DEAD = 2  # clocks
SHIFT = 20  # of the modulator's scale
BYPASS, DOUBLE, REGULATE = 1 << 3, 1 << 2, 3 << 4  # of foc.control


def locked_plant(motor: Motor, inverter: Inverter) -> PlantParams:
    """The machine with its rotor held at angle 0."""
    return PlantParams(
        machine=machine_params(motor),
        inverter=inverter_params(inverter),
        sensing=sensing_params(inverter, motor.phases),
        mechanics=MechanicsParams(motor.inertia_kgm2, mode="locked"),
        recording=RecordingParams(every_strobes=1),
        clock_period_s=1.0 / CLOCK_HZ,
    )


def bypassed(period: int, offset: int, inverter: Inverter, omega_hz: float, control: int = BYPASS) -> list[Row]:
    """Vector path without regulators, gates on, a tick at every sample: `offset` clocks after the carriers' start.

    control: bits of foc.control beyond source and enable.
    """
    scale = round(period * inverter.sensing.voltage_full_scale_v / inverter.supply_v / 2**17 * 2**SHIFT)
    assert scale < 2**17
    return [
        *(Row("sense.offset", PHASES + x, 2048 << 4) for x in range(PHASES)),
        Row("sense.scheduler", 0, 3 | offset << 16),
        Row("foc.period", 0, period),
        Row("foc.window", 0, offset),
        Row("foc.scale", 0, scale | SHIFT << 24),
        Row("foc.omega", 0, round(omega_hz / CLOCK_HZ * 2**36)),
        Row("foc.control", 0, 1 | 1 << 1 | control),  # source, enable
        Row("safety.trip_enable", 0, 0),
        Row("safety.dead_time", 0, DEAD),
        Row("timer.tick_period", 0, 1000),
        wait(2),
        Row("timer.tick_samples", 0, 1),
        Row("safety.guard", 0, 1),
    ]


def voltage_q17(volts: float, inverter: Inverter) -> int:
    """A voltage as the registers take it."""
    return round(volts / inverter.sensing.voltage_full_scale_v * 2**17)
