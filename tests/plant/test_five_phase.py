# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Five phases: the machine's two forms, the five-leg inverter, open phases and stuck switches."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fluxlock.plant import (
    HallParams,
    InverterParams,
    MachineParams,
    MechanicsParams,
    Plant,
    PlantParams,
    RecordingParams,
    SensingParams,
    ThirdParams,
    channel_names,
)
from fluxlock.plant import layout as L
from fluxlock.plant.magnetics import rotor_axes
from tests.plant.circuits import random_five_phase, random_gates
from tests.plant.reference import wound
from tests.plant.test_circuits import COUPLED_LIMIT, IMPOSED_LIMIT, VOLTAGE_LIMIT, Comparison
from tests.plant.test_energy import ELECTRICAL_LIMIT, electrical_remainder

SUPPLY_V, R_ON_OHM, CLOCK_S = 200.0, 0.02, 20e-9
ROUNDING = 1e-13
YU = MachineParams(9, (0.5,) * 5, (11.8e-3,) * 5, (0.098,) * 5, l_q_h=13.7e-3, phases=5, third=ThirdParams(2e-3, 2e-3))


def tian(**changes: object) -> PlantParams:
    """Tian's machine on a stiff supply; changes as section__field=value."""
    third = ThirdParams(l_d_h=1.34e-3, l_q_h=2.06e-3, mutual_h=0.3e-3, psi_vs=0.033492)
    base = PlantParams(
        MachineParams(4, (1.3,) * 5, (6.54e-3,) * 5, (0.535872,) * 5, l_q_h=8.32e-3, phases=5, third=third),
        InverterParams(SUPPLY_V, r_on_ohm=R_ON_OHM),
        SensingParams(250.0, 20.0, noise_lsb_rms=0.0),
        MechanicsParams(0.12, omega_m_rad_s=8.0, viscous_nm_s_per_rad=1.2),
        RecordingParams(energies=True),
        CLOCK_S,
    )
    for key, value in changes.items():
        section, _, name = key.partition("__")
        part = dataclasses.replace(getattr(base, section), **{name: value})  # type: ignore[arg-type]
        base = dataclasses.replace(base, **{section: part})  # type: ignore[arg-type]
    return base


def two_planes(m: MachineParams, omega: float, i: np.ndarray, slope: np.ndarray) -> np.ndarray:
    """Voltages d, q, d3, q3 by the equations of two orthogonal synchronous planes, one at three times the angle."""
    assert m.third is not None and m.l_q_h is not None
    l_d, l_q, l_d3, l_q3, l_13 = m.l_h[0], m.l_q_h, m.third.l_d_h, m.third.l_q_h, m.third.mutual_h
    own = np.array([[l_d, 0, l_13, 0], [0, l_q, 0, l_13], [l_13, 0, l_d3, 0], [0, l_13, 0, l_q3]])
    turning = np.array(
        [[0, -l_q, 0, -l_13], [l_d, 0, l_13, 0], [0, -3 * l_13, 0, -3 * l_q3], [3 * l_13, 0, 3 * l_d3, 0]]
    )
    emf = omega * np.array([0.0, m.psi_vs[0], 0.0, 3 * m.third.psi_vs])
    return np.asarray(m.r_ohm[0] * i + own @ slope + omega * turning @ i + emf)


# ---- the machine


@pytest.mark.parametrize("mode", ["py", "jit"])
def test_phases_and_planes_are_one_machine(mode: str) -> None:
    """100 random machines and states: inductances in phase axes, from winding functions, and in two planes; voltages.

    Verifies: PLANT-20
    """
    seed = 20261
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    for _ in range(100):
        params = random_five_phase(rng)
        m = dataclasses.replace(params.machine, r_ohm=(params.machine.r_ohm[0],) * 5)
        theta, omega = float(rng.uniform(0, 2 * np.pi)), float(rng.uniform(-2000, 2000))
        mechanics = dataclasses.replace(
            params.mechanics, theta_e_rad=theta, omega_m_rad_s=omega / m.pole_pairs, profile=()
        )
        plant = Plant(dataclasses.replace(params, machine=m, mechanics=mechanics), seed=1, mode=mode)
        i, slope = (rng.uniform(-1, 1, 5) for _ in range(2))
        i, slope = i - i.mean(), 1e4 * (slope - slope.mean())
        plant.state[L.I : L.I + 5] = i
        plant.inject_fault("clear")  # has the machine look at its currents
        lmat, turning = wound(m, theta)
        angles = theta - 0.4 * np.pi * np.arange(5)
        assert m.third is not None
        emf = -omega * (m.psi_vs[0] * np.sin(angles) + 3 * m.third.psi_vs * np.sin(3 * angles))
        scale = np.abs(lmat).max()
        # The zero sequence, which no current shows, is taken and may differ.
        own = plant.state[L.LM : L.LM + 25].reshape(5, 5)
        assert np.ptp(own - lmat) <= ROUNDING * scale
        phases = m.r_ohm[0] * i + lmat @ slope + omega * turning @ i + emf
        kernel = m.r_ohm[0] * i + own @ slope + omega * plant.state[L.FLUX_SLOPE : L.FLUX_SLOPE + 5]
        planes = two_planes(m, omega, rotor_axes(theta, 5, i), to_rotor_slope(theta, omega, i, slope))
        size = np.abs(phases).max()
        assert np.abs(kernel - phases).max() <= ROUNDING * size
        assert np.abs(rotor_axes(theta, 5, phases) - planes).max() <= ROUNDING * size
        i_d, i_q, i_d3, i_q3 = rotor_axes(theta, 5, i)
        t, l_q = m.third, m.l_q_h
        assert l_q is not None
        flux_d, flux_q = m.psi_vs[0] + m.l_h[0] * i_d + t.mutual_h * i_d3, l_q * i_q + t.mutual_h * i_q3
        flux_d3, flux_q3 = t.psi_vs + t.l_d_h * i_d3 + t.mutual_h * i_d, t.l_q_h * i_q3 + t.mutual_h * i_q
        torque = flux_d * i_q - flux_q * i_d + 3 * (flux_d3 * i_q3 - flux_q3 * i_d3)
        assert plant.torque_nm == pytest.approx(2.5 * m.pole_pairs * torque, rel=1e-10)


def to_rotor_slope(theta: float, omega: float, i: np.ndarray, slope: np.ndarray) -> np.ndarray:
    """Slope of the currents in rotor axes from that in the phases."""
    i_d, i_q, i_d3, i_q3 = rotor_axes(theta, 5, i)
    return np.asarray(rotor_axes(theta, 5, slope) + omega * np.array([i_q, -i_d, 3 * i_q3, -3 * i_d3]))


def test_two_planes_integrated() -> None:
    """Half a turn of switched five-leg vectors: currents and torque as scipy integrates the equations in two planes.

    Verifies: PLANT-20
    """
    omega, theta0 = 300.0, 0.7
    mechanics = MechanicsParams(0.12, mode="imposed", theta_e_rad=theta0, omega_m_rad_s=omega / 4)
    params = dataclasses.replace(tian(), mechanics=mechanics)
    m = dataclasses.replace(params.machine, r_ohm=(params.machine.r_ohm[0] + R_ON_OHM,) * 5)
    plant = Plant(params, seed=1)
    own = np.linalg.inv(np.array([two_planes(m, 0.0, np.zeros(4), e) for e in np.eye(4)]).T)
    rng = np.random.default_rng(5)
    y, t, largest = np.zeros(4), 0, 0.0
    while t * CLOCK_S < np.pi / omega:
        gates = sum((1 if rng.random() < 0.5 else 2) << (2 * x) for x in range(5))
        v = np.array([SUPPLY_V * (gates >> (2 * x) & 1) for x in range(5)])

        def slopes(at: float, i: np.ndarray, v: np.ndarray = v) -> np.ndarray:
            return np.asarray(own @ (rotor_axes(theta0 + omega * at, 5, v) - two_planes(m, omega, i, np.zeros(4))))

        plant.step(t, gates, 2)
        after = t + int(rng.integers(500, 5000))
        y = solve_ivp(slopes, (t * CLOCK_S, after * CLOCK_S), y, method="DOP853", rtol=1e-11, atol=1e-11).y[:, -1]
        t = after
        plant.step(t, gates, 0)
        assert plant.rotor_currents_a == pytest.approx(y, abs=1e-8)
        largest = max(largest, float(np.abs(y).max()))
    assert largest > 2.0


# ---- five legs: diodes, dead time, floating and broken phases against the independent solution


def check(c: Comparison, where: str) -> None:
    print(f"{where[:12]}: {c.rows} gate changes, current error / peak {c.current / max(c.peak, 1e-9):.1e}")
    assert c.current <= IMPOSED_LIMIT * c.peak, where
    assert c.link <= VOLTAGE_LIMIT, where
    assert c.terminal <= VOLTAGE_LIMIT, where
    assert c.terminals_compared > 0.9 * c.rows, where


def five(rng: np.random.Generator, mechanics: str, pole_s: float, salient: bool) -> PlantParams:
    return random_five_phase(rng, mechanics, pole_s)


@pytest.mark.parametrize("batch", range(3))
def test_imposed_speed(batch: int) -> None:
    """Three random five-leg circuits each: currents, link, terminals and diode instants.

    Verifies: PLANT-21
    """
    for seed in range(7000 + 3 * batch, 7003 + 3 * batch):
        c = Comparison(seed, "imposed", duration=150_000, make=five)
        where = f"seed {seed}: {c.params}"
        check(c, where)
        assert c.peak > 0, where
        if not c.params.mechanics.profile:
            mine, other = c.plant_events(), c.reference.log
            assert [e[1:] for e in mine] == [e[1:] for e in other], where
            assert np.allclose([e[0] for e in mine], [e[0] for e in other], rtol=0, atol=1e-10), where


def test_coupled_with_mechanics() -> None:
    """Four random circuits with a free rotor.

    Verifies: PLANT-21
    """
    for seed in range(7100, 7104):
        c = Comparison(seed, "free", duration=150_000, make=five)
        print(f"seed {seed}: current error / peak {c.current / max(c.peak, 1e-9):.1e}, speed {c.speed:.1e}")
        assert c.current <= COUPLED_LIMIT * c.peak, f"seed {seed}: {c.params}"
        assert c.speed <= COUPLED_LIMIT, f"seed {seed}: {c.params}"


@pytest.mark.parametrize("broken", [(0,), (3,), (1, 4), (0, 2, 3)])
def test_broken_phases(broken: tuple[int, ...]) -> None:
    """One, two and three phases open: the others and the terminals of all follow the independent solution.

    Verifies: PLANT-22
    """
    seed = 7200 + sum(broken)
    c = Comparison(seed, "imposed", duration=150_000, make=five, broken=broken)
    check(c, f"seed {seed}: {broken} {c.params}")
    assert c.peak > 0


def test_broken_phase_of_three() -> None:
    """An open phase of a three-phase machine, salient and not.

    Verifies: PLANT-22
    """
    for seed in range(7300, 7304):
        c = Comparison(seed, "imposed", duration=150_000, salient=seed % 2 == 1, broken=(seed % 3,))
        check(c, f"seed {seed}: {c.params}")


@pytest.mark.parametrize("phases", [(2,), (0, 3)])
def test_current_of_a_breaking_phase(phases: tuple[int, ...]) -> None:
    """A phase that opens has no current; the others take it over with their flux linkages but for the star's impulse.

    Verifies: PLANT-22
    """
    plant = Plant(tian(), seed=1)
    plant.step(0, 0b0110011001, 2)
    plant.advance(200_000)
    before = plant.state[L.LM : L.LM + 25].reshape(5, 5) @ plant.currents_a
    assert np.abs(plant.currents_a).min() > 0.3
    plant.inject_fault("open_phase", phases=phases)
    i = plant.currents_a
    assert not i[list(phases)].any() and abs(i.sum()) <= 1e-13 * np.abs(i).max()
    change = plant.state[L.LM : L.LM + 25].reshape(5, 5) @ i - before
    others = [x for x in range(5) if x not in phases]
    assert np.ptp(change[others]) <= 1e-12
    assert np.abs(change[list(phases)] - change[others[0]]).min() > 1e-4
    plant.advance(400_000)
    assert not plant.currents_a[list(phases)].any() and np.abs(plant.currents_a).max() > 0.3
    plant.inject_fault("clear")
    plant.advance(600_000)
    assert np.abs(plant.currents_a[list(phases)]).min() > 0.1


def test_stuck_switch() -> None:
    """A switch that is stuck on conducts with all gates off; the other gate sets the fault pin and does nothing else.

    Verifies: PLANT-22
    """
    params = tian(mechanics__mode="imposed", mechanics__omega_m_rad_s=30.0)
    for kind, own, other, rail_v in (("stuck_high", 1, 2, SUPPLY_V), ("stuck_low", 2, 1, 0.0)):
        plant, healthy = Plant(params, seed=1), Plant(params, seed=1)
        for p in (plant, healthy):
            p.step(0, 0, 2)
            p.advance(1_000)
        plant.inject_fault(kind, phases=(1,))
        plant.step(2_000, own << 2, 2)
        largest = 0.0
        for t in range(100_000, 2_700_000, 100_000):  # a turn
            plant.advance(t)
            drop = plant.currents_a[1] * R_ON_OHM
            assert plant.terminals_v[1] == pytest.approx(rail_v - drop, abs=1e-9)
            largest = max(largest, abs(drop) / R_ON_OHM)
        healthy.advance(2_600_000)
        assert largest > 1.0 and not healthy.currents_a.any()
        assert not plant.io[L.IO_PINS] & 1
        plant.step(2_700_000, other << 2, 2)
        assert plant.io[L.IO_PINS] & 1
        plant.advance(2_700_100)
        assert plant.terminals_v[1] == pytest.approx(rail_v - plant.currents_a[1] * R_ON_OHM, abs=1e-9)
        plant.inject_fault("clear")
        plant.step(2_700_200, 0, 2)
        assert not plant.io[L.IO_PINS] & 1


# ---- the rest


def test_balance() -> None:
    """The electrical energy balance closes.

    Verifies: PLANT-21
    """
    for seed in range(7500, 7530):
        rng = np.random.default_rng(seed)
        plant = Plant(random_five_phase(rng, "imposed"), seed=seed)
        start = plant.energies_j()
        for t, gates in random_gates(rng, 200_000, 5):
            plant.step(t, gates, 2)
        assert abs(electrical_remainder(start, plant.energies_j())) <= ELECTRICAL_LIMIT, f"seed {seed}"


def test_identical_bits() -> None:
    """Plain Python and compiled code agree, with samples and records.

    Verifies: PLANT-06, PLANT-20
    """
    for seed in range(3):
        rng = np.random.default_rng(seed)
        params = random_five_phase(rng, "free" if seed % 2 else "imposed", 1e-7 * (seed % 3))
        gates = dict(random_gates(rng, 30_000, 5))
        plants = [Plant(params, seed=seed, mode=mode) for mode in ("py", "jit")]
        for plant in plants:
            plant.configure_recording(3, ((10_000, 20_000),))
            now = 0
            for t in sorted({*gates, *range(500, 30_000, 500)}):
                now = gates.get(t, now)
                plant.step(t, now, int(t % 500 == 0))
        assert plants[0].state.tobytes() == plants[1].state.tobytes(), f"seed {seed}"
        assert plants[0].io.tobytes() == plants[1].io.tobytes(), f"seed {seed}"


def test_channels_and_records() -> None:
    """13 channels in the order va .. ve, ia .. ie, vdc, idc, vsm; records have a column for each phase.

    Verifies: PLANT-21
    """
    names = channel_names(5)
    assert names == ("va", "vb", "vc", "vd", "ve", "ia", "ib", "ic", "id", "ie", "vdc", "idc", "vsm")
    offsets = tuple(float(k) for k in range(13))
    plant = Plant(tian(sensing__offset_lsb=offsets, sensing__divider_gain=(1.0, 0.9, 1.1, 1.0, 0.8)), seed=1)
    plant.step(50, 0b0110011001, 3)
    plant.configure_recording(1)
    codes = plant.sample(5_000)
    row = plant.records()[-1]
    assert list(codes.shape) == [13]
    for x, gain in enumerate((1.0, 0.9, 1.1, 1.0, 0.8)):
        assert codes[x] == pytest.approx(plant.terminals_v[x] * gain * 4096 / 250 + x, abs=0.51)
        assert codes[5 + x] == pytest.approx(2048 + plant.currents_a[x] * 4096 / 40 + 5 + x, abs=0.51)
        assert row["i" + "abcde"[x]] == plant.currents_a[x] and row["v" + "abcde"[x]] == plant.terminals_v[x]
    assert codes[10] == pytest.approx(SUPPLY_V * 4096 / 250 + 10, abs=0.51)
    assert codes[11] == pytest.approx(2048 + row["idc"] * 4096 / 40 + 11, abs=0.51)
    assert codes[12] == pytest.approx(plant.terminals_v.mean() * 4096 / 250 + 12, abs=0.51)
    assert row["torque_nm"] == plant.torque_nm and row["gates"] == 0b0110011001
    plant.inject_fault("stuck_channel", channel="ie", code=77)
    assert plant.sample(5_100)[9] == 77


def test_free_rotor_under_load() -> None:
    """Steady currents turn the rotor against its viscous load at the speed that the torque demands.

    Verifies: PLANT-20
    """
    params = tian(mechanics__inertia_kgm2=1e-3, mechanics__omega_m_rad_s=0.0)
    plant = Plant(params, seed=1)
    plant.step(0, 0b1010010101, 2)  # A, B, C high; D, E low: the rotor turns to phase B and stays
    for t in range(1, 200):
        plant.advance(t * 100_000)
    assert plant.omega_e_rad_s == pytest.approx(0.0, abs=1e-3)
    assert math.degrees(plant.theta_e_rad) % 360.0 == pytest.approx(72.0, abs=0.01)
    assert plant.rotor_currents_a[1] == pytest.approx(0.0, abs=1e-3) and plant.rotor_currents_a[0] > 10.0


def test_rated_brake() -> None:
    """Behind a Coulomb brake of 11 N*m a rotor stays at rest with 4.8 A, not with 5.6 A, nor as the brake is released.

    Verifies: PLANT-10, PLANT-20
    """

    def braked(supply_v: float) -> Plant:
        # A high, B to E low: a current along the axis of phase A, with the rotor a quarter of a turn behind it.
        mechanics = MechanicsParams(5e-3, coulomb_nm=11.0, viscous_nm_s_per_rad=2e-3, theta_e_rad=-math.pi / 2)
        plant = Plant(PlantParams(YU, InverterParams(supply_v), SensingParams(450.0, 10.0), mechanics), seed=1)
        plant.step(0, 0b1010101001, 2)
        plant.advance(round(0.4 / CLOCK_S))
        return plant

    plant = braked(6.0)
    assert plant.rotor_currents_a[1] == pytest.approx(4.8, rel=1e-3)
    assert plant.torque_nm == pytest.approx(22.5 * 0.098 * 4.8, rel=1e-3)
    assert plant.omega_e_rad_s == 0.0
    start = plant.theta_e_rad
    plant.set_load(coulomb_nm=0.0, ramp_s=0.1)
    plant.advance(plant.t_cycle + round(2e-3 / CLOCK_S))
    assert plant.theta_e_rad == start
    plant.advance(plant.t_cycle + round(20e-3 / CLOCK_S))
    assert plant.theta_e_rad - start > 0.1
    assert braked(7.0).theta_e_rad - start > 0.1


@pytest.mark.parametrize("omega", [0.0, 2.4e-19, 1e-12, 1e-6])
def test_two_legs_at_one_rail_beside_a_rotor_that_hardly_turns(omega: float) -> None:
    """Equal voltages at two legs drive no current, a rounding of them at most.

    Verifies: PLANT-12, PLANT-20
    """
    plant = Plant(tian(), seed=1, mode="jit")
    plant.state[L.OMEGA] = omega
    for cycle in range(10, 4_000, 50):
        plant.step(cycle, 0b010001)
    assert abs(plant.currents_a).max() < 1e-6


def test_shorted_winding() -> None:
    """Fewer turns of one phase: its inductances fall with their product, and come back.

    Verifies: PLANT-12, PLANT-20
    """
    plant = Plant(tian(), seed=1)
    plant.step(0, 0b0110011001, 2)
    plant.advance(50_000)
    whole = plant.state[L.LM : L.LM + 25].copy()
    plant.inject_fault("shorted_winding", phases=(3,), turns_fraction=0.25)
    factors = np.array([1.0, 1.0, 1.0, 0.25, 1.0])
    left = plant.state[L.LM : L.LM + 25].reshape(5, 5)
    assert left == pytest.approx(whole.reshape(5, 5) * np.outer(factors, factors), rel=1e-12)
    plant.advance(100_000)
    plant.inject_fault("clear")
    assert plant.state[L.LM : L.LM + 25] == pytest.approx(
        Plant(tian(mechanics__theta_e_rad=plant.theta_e_rad), seed=1).state[L.LM : L.LM + 25], rel=1e-12
    )


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"phases": 4}, "phases = 4: must be 3 or 5"),
        ({"phases": 3}, "r_ohm = .*: must be 3 values"),
        ({"third": None}, "third = None: must be given with 5 phases and only there"),
        ({"third": ThirdParams(1e-3, 2e-3, mutual_h=2.6e-3)}, "l_h, l_q_h, third = .*: must be positive definite"),
        ({"l_h": (1e-3, 1e-3, 1e-3, 1e-3, 2e-3), "l_q_h": None}, "l_h = .*: must be equal for all phases"),
        ({"emf": "trapezoidal"}, "emf = 'trapezoidal': must be sinusoidal with 5 phases"),
        ({"hall": HallParams()}, "hall = .*: must be None with 5"),
    ],
)
def test_refused(changes: dict[str, object], message: str) -> None:
    """Parameters that are no five-phase machine are named.

    Verifies: PLANT-13, PLANT-20
    """
    with pytest.raises(ValueError, match=message):
        dataclasses.replace(tian().machine, **changes)  # type: ignore[arg-type]


def test_refused_elsewhere() -> None:
    """Sensing of other legs, phases that are not there, inductances that are none.

    Verifies: PLANT-13, PLANT-20
    """
    with pytest.raises(ValueError, match=r"divider_gain = .*: must be 5 values, or none"):
        tian(sensing__divider_gain=(1.0, 1.0, 1.0))
    with pytest.raises(ValueError, match=r"phases = \(5,\): must be numbers 0 to 4"):
        Plant(tian(), seed=1, mode="py").inject_fault("open_phase", phases=(5,))
    with pytest.raises(ValueError, match=r"l_q_h = 0\.0: must be above 0"):
        ThirdParams(1e-3, 0.0)
    three = MachineParams(1, (0.02,) * 3, (22e-6,) * 3, (1e-3,) * 3)
    with pytest.raises(ValueError, match=r"third = .*: must be given with 5 phases and only there"):
        dataclasses.replace(three, third=ThirdParams(1e-3, 1e-3))
