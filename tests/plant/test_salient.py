# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Salient machines: phase inductances that turn with the rotor."""

from __future__ import annotations

import dataclasses
import itertools
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fluxlock.plant import MechanicsParams, Plant, PlantParams
from fluxlock.plant import layout as L
from tests.plant.circuits import random_gates, random_params
from tests.plant.drives import CLOCK_S, drive, motor_1
from tests.plant.test_circuits import COUPLED_LIMIT, IMPOSED_LIMIT, VOLTAGE_LIMIT, Comparison
from tests.plant.test_energy import ELECTRICAL_LIMIT, electrical_remainder

L_D_H, L_Q_H, R_OHM, PSI_VS, POLE_PAIRS = 120e-6, 240e-6, 0.06, 8e-3, 4
SUPPLY_V, R_ON_OHM = 48.0, 5e-3
CARRIER_CYCLES = 2500  # 50 us
FULL_SCALE_A = 50.0
CARRIER_LIMIT = 1e-6  # of the current's full scale


def ipm(**changes: object) -> PlantParams:
    """An interior-magnet machine on a stiff 48 V supply; changes as section__field=value."""
    base = motor_1(
        machine__pole_pairs=POLE_PAIRS,
        machine__r_ohm=(R_OHM,) * 3,
        machine__l_h=(L_D_H,) * 3,
        machine__l_q_h=L_Q_H,
        machine__psi_vs=(PSI_VS,) * 3,
        inverter__supply_v=SUPPLY_V,
        inverter__r_on_ohm=R_ON_OHM,
        inverter__supply_r_ohm=0.0,
        mechanics__inertia_kgm2=8e-5,
        mechanics__fan_nm_s2_per_rad2=0.0,
        mechanics__omega_m_rad_s=300.0,
    )
    for key, value in changes.items():
        section, _, name = key.partition("__")
        part = dataclasses.replace(getattr(base, section), **{name: value})  # type: ignore[arg-type]
        base = dataclasses.replace(base, **{section: part})  # type: ignore[arg-type]
    return base


# ---- against the independent natural-frame solution: diodes, dead time, floating legs


@pytest.mark.parametrize("batch", range(4))
def test_imposed_speed(batch: int) -> None:
    """Eight random salient circuits each: currents, link, terminals and diode instants at imposed speed.

    Verifies: PLANT-18
    """
    flowing = 0
    for seed in range(3000 + 8 * batch, 3008 + 8 * batch):
        c = Comparison(seed, "imposed", duration=200_000, salient=True)
        where = f"seed {seed}: {c.params}"
        print(f"seed {seed}: {c.rows} gate changes, current error / peak {c.current / max(c.peak, 1e-9):.1e}")
        assert c.current <= IMPOSED_LIMIT * c.peak, where
        assert c.link <= VOLTAGE_LIMIT, where
        assert c.terminal <= VOLTAGE_LIMIT, where
        assert c.terminals_compared > 0.9 * c.rows, where
        flowing += c.peak > 0
        if not c.params.mechanics.profile:
            mine, other = c.plant_events(), c.reference.log
            assert [e[1:] for e in mine] == [e[1:] for e in other], where
            assert np.allclose([e[0] for e in mine], [e[0] for e in other], rtol=0, atol=1e-10), where
    assert flowing >= 7


def test_coupled_with_mechanics() -> None:
    """Ten random salient circuits with a free rotor: reluctance torque moves it.

    Verifies: PLANT-18
    """
    for seed in range(4000, 4010):
        c = Comparison(seed, "free", duration=200_000, salient=True)
        print(f"seed {seed}: current error / peak {c.current / max(c.peak, 1e-9):.1e}, speed {c.speed:.1e}")
        assert c.current <= COUPLED_LIMIT * c.peak, f"seed {seed}: {c.params}"
        assert c.speed <= COUPLED_LIMIT, f"seed {seed}: {c.params}"


def test_balance() -> None:
    """The electrical energy balance closes with reluctance torque in the shaft energy.

    Verifies: PLANT-18
    """
    for seed in range(6000, 6040):
        rng = np.random.default_rng(seed)
        params = random_params(rng, "imposed", salient=True)
        plant = Plant(params, seed=seed, mode="jit")
        start = plant.energies_j()
        for t, gates in random_gates(rng, 200_000):
            plant.step(t, gates, 2)
        assert abs(electrical_remainder(start, plant.energies_j())) <= ELECTRICAL_LIMIT, f"seed {seed}"


# ---- against the dq equations


def dq_slopes(gates: int, omega: float, theta0: float, t: float, y: np.ndarray) -> np.ndarray:
    """d/dt of (i_d, i_q) at constant electrical speed with all three legs switched."""
    theta = theta0 + omega * t
    v = np.array([SUPPLY_V * (gates >> (2 * x) & 1) for x in range(3)])
    angles = theta - np.array([0.0, 2.0, 4.0]) * np.pi / 3
    v_d, v_q = 2 / 3 * v @ np.cos(angles), -2 / 3 * v @ np.sin(angles)
    r = R_OHM + R_ON_OHM
    i_d, i_q = y
    return np.array(
        [
            (v_d - r * i_d + omega * L_Q_H * i_q) / L_D_H,
            (v_q - r * i_q - omega * (L_D_H * i_d + PSI_VS)) / L_Q_H,
        ]
    )


def test_dq_equations() -> None:
    """A turn of switched vectors: i_d, i_q as the dq equations give them, torque 3/2 p (psi i_q + (L_d - L_q) i_d i_q).

    Verifies: PLANT-18
    """
    theta0 = 0.7
    mechanics = MechanicsParams(8e-5, mode="imposed", theta_e_rad=theta0, omega_m_rad_s=500.0)
    plant = Plant(dataclasses.replace(ipm(), mechanics=mechanics), seed=1)
    omega = 500.0 * POLE_PAIRS
    y = np.zeros(2)
    rng = np.random.default_rng(5)
    largest = 0.0
    reluctance: list[float] = []
    t = 0
    while t * CLOCK_S < 2 * math.pi / omega:
        gates = sum((1 if rng.random() < 0.5 else 2) << (2 * x) for x in range(3))
        plant.step(t, gates, 2)
        after = t + int(rng.integers(300, 1500))
        span = (t * CLOCK_S, after * CLOCK_S)
        out = solve_ivp(
            lambda at, x, gates=gates: dq_slopes(gates, omega, theta0, at, x), span, y, rtol=1e-11, atol=1e-11
        )
        y, t = out.y[:, -1], after
        plant.step(t, gates, 0)
        angles = plant.theta_e_rad - np.array([0.0, 2.0, 4.0]) * np.pi / 3
        i = plant.currents_a
        i_d, i_q = 2 / 3 * i @ np.cos(angles), -2 / 3 * i @ np.sin(angles)
        assert (i_d, i_q) == pytest.approx(tuple(y), abs=1e-7)
        reluctance.append(1.5 * POLE_PAIRS * (L_D_H - L_Q_H) * y[0] * y[1])
        torque = 1.5 * POLE_PAIRS * PSI_VS * y[1] + reluctance[-1]
        assert plant.state[L.TORQUE] == pytest.approx(torque, abs=1e-8)
        largest = max(largest, abs(i_d), abs(i_q))
    assert largest > 10.0
    assert max(map(abs, reluctance)) > 0.1, "without reluctance torque the test shows nothing"


# ---- error over a carrier


def carrier_gates(t: int) -> int:
    """Centred pulses of unlike duty on three legs, 400 ns of dead time; the last leg floats in the middle."""
    gates = 0
    for x, duty in enumerate((0.7, 0.35, 0.5)):
        at, half, dead = t % CARRIER_CYCLES, duty * CARRIER_CYCLES / 2, 20
        off = abs(at - CARRIER_CYCLES / 2)
        if x == 2 and off < CARRIER_CYCLES / 8:
            continue
        gates |= (1 if off < half - dead else 2 if off >= half else 0) << (2 * x)
    return gates


def after_carrier(params: PlantParams, parts: int) -> np.ndarray:
    """Currents, angle and speed after four carriers; the intervals between edges of the last one in so many parts."""
    plant = Plant(params, seed=1)
    last = 3 * CARRIER_CYCLES
    edges = [t for t in range(1, 4 * CARRIER_CYCLES) if carrier_gates(t) != carrier_gates(t - 1)]
    for begin, end in itertools.pairwise([0, *edges, 4 * CARRIER_CYCLES]):
        gates = carrier_gates(begin)
        plant.step(begin, gates, 2)
        for k in range(1, parts if end > last else 1):
            plant.step(begin + (end - begin) * k // parts, gates, 0)
    plant.advance(4 * CARRIER_CYCLES)
    return np.array([*plant.currents_a, plant.theta_e_rad, plant.omega_e_rad_s])


def test_steps_at_constant_speed_do_not_matter() -> None:
    """Between events the solution is exact: halving the steps changes nothing but rounding.

    Verifies: PLANT-18
    """
    params = ipm(mechanics__mode="imposed")
    whole = after_carrier(params, 1)
    assert np.abs(whole[:3]).max() > 5.0
    for parts in (2, 4, 8):
        change = np.abs(after_carrier(params, parts) - whole)[:3].max()
        print(f"{parts} parts: {change:.1e} A")
        assert change <= 1e-10


def test_free_rotor_over_a_carrier() -> None:
    """Splitting of rotor and circuit: below 1e-6 of full scale over a switched carrier at the step in force.

    Verifies: PLANT-18
    """
    exact = after_carrier(ipm(mechanics__step_max_s=1e-8), 1)
    error = np.abs(after_carrier(ipm(), 1) - exact)
    print(f"{error[:3].max():.1e} A, {error[3]:.1e} rad")
    assert error[:3].max() <= CARRIER_LIMIT * FULL_SCALE_A


def test_free_rotor_is_of_second_order() -> None:
    """Half the step, a quarter of the error, while no edge or diode bends the currents.

    Verifies: PLANT-18
    """
    ends = []
    for step_s in (8e-6, 4e-6, 2e-6, 1e-6, 31.25e-9):
        # A light rotor, so that rounding stays far below the error.
        plant = Plant(ipm(mechanics__step_max_s=step_s, mechanics__inertia_kgm2=1e-7), seed=1)
        plant.step(1, 0b100101, 2)
        plant.step(1 + 8_000, 0b100101, 0)
        ends.append(np.array([*plant.currents_a, plant.theta_e_rad]))
    errors = [float(np.abs(end - ends[-1])[:3].max()) for end in ends[:-1]]
    print("error, A: " + ", ".join(f"{e:.1e}" for e in errors))
    for coarse, fine in itertools.pairwise(errors):
        assert 3.8 < coarse / fine < 4.2


def test_long_step_of_two_legs() -> None:
    """Two conducting legs, L_q = 4 L_d, a step of a third of a turn at once: halved until its series converges.

    Verifies: PLANT-18
    """
    params = ipm(machine__l_q_h=4 * L_D_H, machine__psi_vs=(1e-6,) * 3, mechanics__mode="imposed")
    ends = []
    for parts in (1, 100):
        plant = Plant(params, seed=1)
        plant.step(1, 0b001001, 2)
        for k in range(1, parts + 1):
            plant.step(1 + 87_000 * k // parts, 0b001001, 0)
        assert plant.currents_a[0] > 100.0
        ends.append(plant.currents_a)
    assert ends[0] == pytest.approx(ends[1], rel=1e-11)


# ---- the rest


def test_identical_bits() -> None:
    """Plain Python and compiled code agree in a drive and over random circuits.

    Verifies: PLANT-06, PLANT-18
    """
    py, jit = (Plant(ipm(), seed=5, mode=mode) for mode in ("py", "jit"))
    drive(py, 600)
    drive(jit, 600)
    assert py.state.tobytes() == jit.state.tobytes() and py.io.tobytes() == jit.io.tobytes()
    for seed in range(4):
        rng = np.random.default_rng(seed)
        params = random_params(rng, "free" if seed % 2 else "imposed", 1e-7 * (seed % 3), salient=True)
        rows = random_gates(rng, 40_000)
        plants = [Plant(params, seed=seed, mode=mode) for mode in ("py", "jit")]
        for t, gates in rows:
            for plant in plants:
                plant.step(t, gates, t % 2)
        assert plants[0].state.tobytes() == plants[1].state.tobytes(), f"seed {seed}"


def test_equal_inductances_are_no_saliency() -> None:
    """L_q = L_d gives what the machine without l_q_h gives.

    Verifies: PLANT-18
    """
    plants = [Plant(ipm(machine__l_q_h=l_q), seed=1) for l_q in (L_D_H, None)]
    unlike = Plant(ipm(), seed=1)
    for plant in (*plants, unlike):
        drive(plant, 2000)
    assert plants[0].currents_a == pytest.approx(plants[1].currents_a, abs=1e-7)
    assert np.abs(unlike.currents_a - plants[1].currents_a).max() > 0.5


def test_shorted_winding() -> None:
    """Turns that no longer act leave the saliency of the others; cleared, the machine is whole again.

    Verifies: PLANT-12, PLANT-18
    """
    plant = Plant(ipm(), seed=1)
    drive(plant, 500)
    whole = plant.state[L.LM : L.LM + 9].copy()
    torque = float(plant.state[L.TORQUE])
    plant.inject_fault("shorted_winding", phases=(1,), turns_fraction=0.25)
    left = plant.state[L.LM : L.LM + 9].reshape(3, 3)
    factors = np.array([1.0, 0.25, 1.0])
    assert left == pytest.approx(whole.reshape(3, 3) * np.outer(factors, factors), rel=1e-12)
    drive(plant, 100)
    plant.inject_fault("clear")
    plant.inject_fault("shorted_winding", phases=(1,), turns_fraction=1.0)
    drive(plant, 100)
    turned = Plant(ipm(mechanics__theta_e_rad=plant.theta_e_rad), seed=1)
    assert plant.state[L.LM : L.LM + 9] == pytest.approx(turned.state[L.LM : L.LM + 9], rel=1e-12)
    assert torque != plant.state[L.TORQUE]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"l_q_h": 0.0}, "l_q_h = 0.0: must be above 0"),
        ({"l_q_h": 1e-4, "l_h": (1e-4, 2e-4, 1e-4)}, "l_h = .*: must be equal three times beside l_q_h"),
        ({"l_q_h": 1e-4, "m_h": (-1e-6,) * 3}, "m_h = .*: must be zero beside l_q_h"),
    ],
)
def test_refused(changes: dict[str, object], message: str) -> None:
    """Parameters that are no salient machine are named.

    Verifies: PLANT-13, PLANT-18
    """
    with pytest.raises(ValueError, match=message):
        ipm(**{f"machine__{key}": value for key, value in changes.items()})


@pytest.mark.parametrize("width", [1, 3])
def test_starts_from_rest(width: int) -> None:
    """Legs that switch a few clocks after one another, at rest and without current: rounding is no current.

    Verifies: PLANT-18
    """
    plant = Plant(ipm(inverter__supply_r_ohm=0.02, mechanics__mode="free", mechanics__omega_m_rad_s=0.0), 1, "py")
    t = 1000
    for period in range(60):
        for upper in (True, False):
            for x in range(3):
                leg = (x + period) % 3
                plant.step(t + 2 * x * width, int(plant.state[L.GATES]) & ~(3 << 2 * leg))
            t += 6 * width + 15
            for x in range(3):
                leg = (x + period) % 3
                plant.step(t + x * width, int(plant.state[L.GATES]) | (1 if upper else 2) << 2 * leg)
            t += 600
    assert np.all(np.abs(plant.currents_a) < 5.0)
    assert math.isfinite(plant.speed_rpm)
