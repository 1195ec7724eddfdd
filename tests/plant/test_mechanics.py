# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Rotor and loads."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from fluxlock.plant import Plant
from fluxlock.plant import layout as L
from tests.plant.drives import CLOCK_S, drive, motor_1

US = 50  # cycles


def coast(plant: Plant, microseconds: int) -> None:
    """Run on with all gates off."""
    plant.advance(plant.t_cycle + microseconds * US)


def test_locked_rotor_stays() -> None:
    """Verifies: PLANT-09."""
    plant = Plant(motor_1(mechanics__mode="locked", mechanics__theta_e_rad=1.0), seed=1, mode="jit")
    plant.set_gates(0b001001)
    coast(plant, 500)
    assert plant.currents_a[0] > 100.0
    assert plant.theta_e_rad == 1.0 and plant.omega_e_rad_s == 0.0


def test_imposed_profile() -> None:
    """Speed and angle follow the corners of the profile; the ends hold; a step is possible.

    Verifies: PLANT-09
    """
    profile = ((1e-3, 1000.0), (2e-3, 3000.0), (2e-3, 2000.0), (4e-3, 2000.0), (5e-3, -1000.0))
    plant = Plant(
        motor_1(mechanics__mode="imposed", mechanics__profile=profile, machine__pole_pairs=2),
        seed=1,
        mode="jit",
    )
    rng = np.random.default_rng(4)
    fine = np.arange(0, 6e-3, 1e-7)
    times = [t for t, _ in profile]
    speeds = [w for _, w in profile]
    theta = 2 * np.concatenate([[0.0], np.cumsum(np.interp(fine[:-1] + 5e-8, times, speeds) * 1e-7)])
    for t in np.sort(rng.integers(1, 300_000, 200)):
        plant.advance(int(t))
        seconds = t * CLOCK_S
        if abs(seconds - 2e-3) > 1e-9:
            assert plant.omega_e_rad_s == pytest.approx(2 * np.interp(seconds, times, speeds), abs=1e-6)
        # The sum has an error of one of its intervals at the step.
        assert plant.theta_e_rad == pytest.approx(np.interp(seconds, fine, theta), abs=3e-4)
    assert plant.omega_e_rad_s == -2000.0


def test_exact_angle_at_constant_speed() -> None:
    """A second at constant speed, in steps of 1 us: the angle is exact to rounding.

    Verifies: PLANT-09
    """
    plant = Plant(motor_1(mechanics__mode="imposed", mechanics__omega_m_rad_s=10_471.9), seed=1, mode="jit")
    for k in range(1, 20_001):
        plant.advance(k * US)
    assert plant.theta_e_rad == pytest.approx(10_471.9 * 0.02, abs=1e-9)


def test_fan_viscous_and_coulomb_coasting() -> None:
    """Coasting down against each load follows its closed form.

    Verifies: PLANT-10
    """
    j, w0, t = 5e-7, 2000.0, 20e-3
    none = {"fan_nm_s2_per_rad2": 0.0}
    cases = {
        "fan": ({"fan_nm_s2_per_rad2": 5e-9}, w0 / (1 + 5e-9 * w0 * t / j)),
        "viscous": ({**none, "viscous_nm_s_per_rad": 2e-5}, w0 * math.exp(-2e-5 * t / j)),
        "coulomb": ({**none, "coulomb_nm": 1e-2}, w0 - 1e-2 * t / j),
        "constant": ({**none, "constant_nm": 1e-2}, w0 - 1e-2 * t / j),
    }
    for name, (load, expected) in cases.items():
        for sign in (1.0, -1.0):
            changes = {f"mechanics__{k}": v for k, v in load.items()}
            plant = Plant(motor_1(mechanics__omega_m_rad_s=sign * w0, **changes), seed=1, mode="jit")
            coast(plant, 20_000)
            wanted = sign * expected
            if name == "constant" and sign < 0:
                wanted = -w0 - 1e-2 * t / j  # drives: it acts against positive rotation always
            assert plant.omega_e_rad_s == pytest.approx(wanted, rel=1e-6), name


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_coulomb_friction_never_drives(sign: float) -> None:
    """The rotor stops, stays exactly at rest, holds against less than breakaway, and breaks away above it.

    Verifies: PLANT-10
    """
    params = motor_1(
        mechanics__omega_m_rad_s=sign * 200.0, mechanics__coulomb_nm=1e-2, mechanics__stiction_ratio=1.5,
        mechanics__fan_nm_s2_per_rad2=0.0,
    )  # fmt: skip
    plant = Plant(params, seed=1, mode="jit")
    stop_us = round(200.0 * 5e-7 / 1e-2 * 1e6)
    speeds = []
    for _ in range(stop_us + 100):
        coast(plant, 1)
        speeds.append(sign * plant.omega_e_rad_s)
    assert all(later <= earlier for earlier, later in itertools.pairwise(speeds))
    assert min(speeds) == 0.0 and speeds[stop_us - 5] > 0.0 and speeds[stop_us + 5] == 0.0
    angle = plant.theta_e_rad
    for torque in (0.9e-2, -0.9e-2, 1.4e-2, -1.4e-2):
        plant.set_load(constant_nm=torque)
        coast(plant, 1000)
        assert plant.omega_e_rad_s == 0.0 and plant.theta_e_rad == angle
    plant.set_load(constant_nm=-sign * 1.6e-2)
    coast(plant, 1000)
    assert sign * plant.omega_e_rad_s == pytest.approx((1.6e-2 - 1e-2) / 5e-7 * 1e-3, rel=2e-3)


def test_load_steps_and_ramps() -> None:
    """A load steps or ramps from its present value, from now or from a given cycle on.

    Verifies: PLANT-10
    """
    plant = Plant(motor_1(mechanics__constant_nm=1.0, mechanics__coulomb_nm=100.0), seed=1, mode="py")
    plant.set_load(constant_nm=2.0, viscous_nm_s_per_rad=0.5)
    coast(plant, 10)
    assert plant.state[L.VALUE + L.CONSTANT] == 2.0 and plant.state[L.VALUE + L.VISCOUS] == 0.5
    plant.set_load(constant_nm=4.0, ramp_s=100e-6, at_cycle=plant.t_cycle + 20 * US)
    coast(plant, 20)
    assert plant.state[L.VALUE + L.CONSTANT] == 2.0
    coast(plant, 50)
    # Loads are held over a step of at most 1 us at their value in its middle.
    assert plant.state[L.VALUE + L.CONSTANT] == pytest.approx(3.0, abs=0.011)
    coast(plant, 51)
    assert plant.state[L.VALUE + L.CONSTANT] == 4.0
    plant.set_supply(10.0, ramp_s=10e-6)
    coast(plant, 5)
    assert 17.0 < plant.state[L.VDC] < 18.0
    coast(plant, 6)
    assert plant.state[L.VDC] == 10.0


def test_fan_drive_reaches_balance() -> None:
    """A six-step drive against a fan settles where mean torque equals fan torque.

    Verifies: PLANT-04, PLANT-10
    """
    plant = Plant(motor_1(mechanics__fan_nm_s2_per_rad2=2e-9, mechanics__inertia_kgm2=5e-8), seed=1, mode="jit")
    drive(plant, 60_000)
    tail = plant.records()[-2000:]
    torque, omega = tail["torque_nm"].mean(), tail["omega_e"]
    assert omega.std() / omega.mean() < 0.05
    assert torque == pytest.approx(2e-9 * (omega**2).mean(), rel=0.02)


def test_second_order_splitting() -> None:
    """Halving the longest step divides the splitting error by four.

    Verifies: PLANT-04
    """

    def end_current(step_s: float) -> float:
        params = motor_1(mechanics__step_max_s=step_s, mechanics__inertia_kgm2=1e-8)
        plant = Plant(params, seed=1, mode="jit")
        plant.set_gates(0b001001)
        plant.advance(12_800)
        return float(plant.currents_a[0])

    exact = end_current(1e-9)
    errors = [abs(end_current(h) - exact) for h in (16e-6, 8e-6, 4e-6)]
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.15)
    assert errors[1] / errors[2] == pytest.approx(4.0, rel=0.15)
