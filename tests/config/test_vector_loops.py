# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Bandwidths by rule: margins, what binds them, and the modes of the whole drive as a second opinion."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from fluxlock.base.paths import ROOT
from fluxlock.config import load_motor, load_scenario
from fluxlock.config.vector_loops import (
    ACCELERATION_RATIO,
    NOMINAL_DEG,
    PLL_BANDWIDTH,
    WORST_DEG,
    across_ohm,
    loops,
    loops_of,
    permitted_ohm,
    plant_of,
    reference_plant,
)
from fluxlock.config.vector_modes import Plant, Point, growth
from fluxlock.cosim.parameters import parameter_block

SCENARIOS = ROOT / "scenarios/vector"
SERVO, MOTOR_I = SCENARIOS / "load-step.toml", SCENARIOS / "id-step.toml"
UNIT = 2 * math.pi / PLL_BANDWIDTH[3]


def servo(*overrides: str) -> Plant:
    """The light servo."""
    return plant_of(load_scenario(SERVO, list(overrides)))


@pytest.mark.parametrize(
    ("path", "overrides"),
    [
        (SERVO, []),
        (SERVO, ["motor.inertia_kgm2=2.77e-4"]),
        (SERVO, ["motor.inertia_kgm2=2.3e-5"]),
        (MOTOR_I, []),
        (SCENARIOS / "encoder.toml", []),
        (SCENARIOS / "encoder.toml", ['drive.vector={angle="observer", handover_rpm=400, observer_every=4}']),
    ],
)
def test_rule_keeps_its_margins(path: object, overrides: list[str]) -> None:
    """Phase margins, the largest acceleration, and no mode that grows, light or at the limit, forward or braking.

    Verifies: VCONF-20
    """
    s = load_scenario(path, overrides)
    plant, found = plant_of(s), loops_of(s)
    print(found, across_ohm(plant))
    assert found.nominal_deg >= NOMINAL_DEG
    assert found.worst_deg >= WORST_DEG
    omega_n, omega_s = found.pll_hz * UNIT, 2 * math.pi * found.speed_hz
    assert omega_n >= 0.999 * ACCELERATION_RATIO * math.sqrt(plant.acceleration * plant.limit_a)
    if plant.sensor_rad:
        return
    assert permitted_ohm(plant, found) > 0.95 * across_ohm(plant)
    for share in (0.3, 0.6, 1.0):
        for current in (0.05 * plant.rated_a, plant.limit_a, -plant.limit_a):
            point = Point(share * plant.omega_max, current)
            assert growth(plant, point, omega_n, omega_s)[0] < 0.0, (share, current)


def test_what_binds_is_named() -> None:
    """A heavy rotor is bound by the dip, a light one by its dead time or its margins, a noisy converter by its noise.

    Verifies: VCONF-20
    """
    plant = servo()
    assert loops(plant).reason == "dead time"
    assert loops(replace(plant, left_v=0.0)).reason == "phase margin"
    heavy = loops(replace(plant, acceleration=plant.acceleration / 1000))
    assert heavy.reason == "dip at a rated load step"
    assert heavy.speed_hz < loops(plant).speed_hz
    light = loops(replace(plant, acceleration=4 * plant.acceleration))
    assert light.reason == "dead time against the largest acceleration"
    noisy = loops(replace(plant, noise_a=40 * plant.noise_a))
    assert noisy.reason == "noise"
    assert noisy.speed_hz < loops(plant).speed_hz


def test_given_bandwidths_are_taken() -> None:
    """One of them is taken as it is, the other by rule beside it; both, with their margins.

    Verifies: VCONF-20
    """
    plant = servo()
    assert loops(plant, pll_hz=700.0).pll_hz == pytest.approx(700.0)
    beside = loops(plant, speed_hz=20.0)
    assert beside.speed_hz == pytest.approx(20.0)
    assert beside.nominal_deg >= NOMINAL_DEG
    both = loops(plant, 700.0, 60.0)
    assert (both.pll_hz, both.speed_hz, both.reason) == (pytest.approx(700.0), pytest.approx(60.0), "given")
    assert both.nominal_deg < loops(plant, 700.0, 30.0).nominal_deg


def test_modes_know_the_swing() -> None:
    """A loop as fast as the rotor: without damping a third of the dead time lets the stator's mode grow, near 270 Hz.

    The swing of the chip at light load came at 277 Hz; the damped drive has none.

    Verifies: VCONF-20
    """
    plant = servo()
    point = Point(1571.0, 0.37)
    across = replace(point, across_ohm=4 / math.pi * 1.4 / 0.37)
    fast, speed = 978 * UNIT, 2 * math.pi * 57
    bare = replace(plant, damping=1.0)
    assert growth(bare, point, fast, speed)[0] < 0.0
    grown, hertz = growth(bare, across, fast, speed)
    assert grown > 0.0
    assert 250.0 < hertz < 290.0
    assert growth(plant, across, fast, speed)[0] < grown / 2
    assert growth(plant, across, 0.6 * fast, speed)[0] < 0.0


def test_braking_power_that_a_small_link_takes() -> None:
    """None where the supply or a chopper takes the energy; else it grows with the link's capacitor.

    Verifies: VCONF-21
    """
    path = SCENARIOS / "deceleration.toml"

    def power(*overrides: str) -> int:
        return parameter_block(load_scenario(path, overrides)).number("vector_brake_power")

    diode = "inverter.supply_diode=true"
    assert power() == 0
    small, large = power(diode, "inverter.dc_link_f=220e-6"), power(diode, "inverter.dc_link_f=440e-6")
    assert large == pytest.approx(2 * small, rel=1e-3)
    # 26 W at 48 V with a taper of 5 V: 0.83 A at 3500 r/min.
    speed = 4 * 3500 / 60 / 50e6 * 2**36
    assert small * 256 / speed / 2**17 * 25.0 == pytest.approx(0.83, rel=0.05)


def test_reference_drive_of_a_motor() -> None:
    """What `fluxlock motor info` prints keeps the rule for every motor file with three phases.

    Verifies: VCONF-20
    """
    for path in sorted((ROOT / "motors").glob("*.toml")):
        found = loops(reference_plant(load_motor(path)))
        assert found.nominal_deg >= NOMINAL_DEG, path
        assert found.worst_deg >= WORST_DEG, path
