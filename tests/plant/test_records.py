# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What the plant records of itself."""

from __future__ import annotations

import numpy as np
import pytest

from fluxlock.plant import EVENT_DTYPE, WAVE_DTYPE, Plant, PlantError
from fluxlock.plant import layout as L
from tests.plant.drives import CLOCK_S, STROBE_CYCLES, drive, motor_1, six_step_gates

RPM_100K = 100_000 / 60 * 2 * np.pi
LIMIT_DEG = 0.005


def test_rows() -> None:
    """Every n-th strobe has a row, equal to the state then; draining takes rows out once.

    Verifies: PLANT-14
    """
    plant = Plant(motor_1(recording__every_strobes=3), seed=1, mode="py")
    drive(plant, 7)
    first = plant.drain()
    assert first.waves.dtype == WAVE_DTYPE and first.events.dtype == EVENT_DTYPE
    assert first.waves["t_cycle"].tolist() == [150.0, 300.0]
    drive(plant, 2)
    row = plant.records()[-1]
    assert row["t_cycle"] == plant.t_cycle == 450
    assert [row["ia"], row["ib"], row["ic"]] == plant.currents_a.tolist()
    assert row["theta_e"] == plant.theta_e_rad and row["omega_e"] == plant.omega_e_rad_s
    assert row["torque_nm"] == plant.state[L.TORQUE] and row["idc"] == plant.state[L.IDC]
    assert plant.drain().waves.size == 1 - 1
    assert plant.records()["t_cycle"].tolist() == [150.0, 300.0, 450.0]


def test_zoom_records_every_event_and_both_sides_of_an_edge() -> None:
    """Inside a window each event has a row, an edge two: old and new gates, terminals before and after.

    Verifies: PLANT-14
    """
    plant = Plant(motor_1(recording__zoom=((100, 200),)), seed=1, mode="py")
    for t, gates, flags in ((50, 9, 2), (99, 9, 1), (100, 9, 1), (150, 8, 3), (200, 8, 1), (201, 8, 1)):
        plant.step(t, gates, flags)
    z = plant.zoom_records()
    assert z["t_cycle"].tolist() == [100.0, 150.0, 150.0, 200.0]
    assert z["gates"].tolist() == [9, 9, 8, 8]
    assert z["va"][1] > 20.0 and z["va"][2] < -0.6
    assert z["idc"][1] > 0.0 and z["idc"][2] == 0.0
    assert plant.records().size == 0


def test_overflow_is_a_fault() -> None:
    """A full buffer stops the plant with a message that says what to do.

    Verifies: PLANT-13, PLANT-14
    """
    for changes in (
        {"recording__wave_rows": 4},
        {"recording__zoom_rows": 4, "recording__zoom": ((0, 10_000),)},
    ):
        plant = Plant(motor_1(recording__every_strobes=1, **changes), seed=1, mode="jit")
        with pytest.raises(PlantError, match="record buffer is full"):
            drive(plant, 5)
    plant = Plant(motor_1(recording__event_rows=2), seed=1, mode="jit")
    with pytest.raises(PlantError, match="record buffer is full"):
        drive(plant, 5000)


def test_events_of_a_drive() -> None:
    """Each commutation ends with the outgoing phase's extinction: floating phases C B A, none of it twice.

    Verifies: PLANT-14
    """
    plant = Plant(motor_1(inverter__supply_v=12.0), seed=1, mode="jit")
    drive(plant, 2000, duty=1.0)
    events = plant.events()
    ends = events[events["kind"] == L.EXTINCTION]
    turns = plant.theta_e_rad / (2 * np.pi)
    assert abs(len(ends) - 6 * turns) <= 2
    steps = np.diff(ends["phase"][1:]) % 3
    assert np.all(steps == 2)
    assert np.all(np.diff(np.degrees(ends["theta_e"]))[1:] == pytest.approx(60.0, abs=3.0))
    assert np.any(ends["t_cycle"] % 1.0 != 0.0)


@pytest.mark.parametrize("inertia", [5e-7, 5e-9])
def test_theta_at(inertia: float) -> None:
    """Angle between records (10 us apart) at 100 000 r/min, with torque ripple: against the state every 1 us.

    Verifies: PLANT-15
    """
    params = motor_1(
        mechanics__omega_m_rad_s=RPM_100K, mechanics__inertia_kgm2=inertia, inverter__supply_v=40.0,
        mechanics__fan_nm_s2_per_rad2=2e-10,
    )  # fmt: skip
    plant = Plant(params, seed=1, mode="jit")
    times, true = [], []
    for k in range(1, 3001):
        t = k * STROBE_CYCLES
        plant.step(t, six_step_gates(plant, t, 0.7), 1)
        if k >= 10:
            times.append(t)
            true.append(plant.theta_e_rad)
    error = np.degrees(plant.theta_at(times) - np.array(true))
    assert np.abs(error).max() < LIMIT_DEG
    speeds = plant.records()["omega_e"]
    assert np.ptp(speeds) > 0.001 * RPM_100K


def test_theta_at_while_accelerating() -> None:
    """Imposed run-up 0 -> 100 000 r/min in 5 ms against its integral.

    Verifies: PLANT-15
    """
    profile = ((0.0, 0.0), (5e-3, RPM_100K))
    plant = Plant(motor_1(mechanics__mode="imposed", mechanics__profile=profile), seed=1, mode="jit")
    drive(plant, 6000)
    t = np.random.default_rng(2).uniform(500, 250_000, 2000)
    true = 0.5 * RPM_100K / 5e-3 * (t * CLOCK_S) ** 2
    assert np.abs(np.degrees(plant.theta_at(t) - true)).max() < LIMIT_DEG


def test_theta_at_outside_the_records() -> None:
    """No extrapolation.

    Verifies: PLANT-15
    """
    plant = Plant(motor_1(), seed=1, mode="py")
    with pytest.raises(ValueError, match="t_cycles"):
        plant.theta_at([0.0])
    drive(plant, 30)
    with pytest.raises(ValueError, match="t_cycles"):
        plant.theta_at([2000.0])
