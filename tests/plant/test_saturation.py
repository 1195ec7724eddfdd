# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Saturation on the d axis and cross-saturation: one co-energy, whatever the currents do."""

from __future__ import annotations

import dataclasses
import itertools
import math

import numpy as np
import pytest

from fluxlock.plant import MachineParams, Plant, PlantParams, SaturationParams, ThirdParams
from fluxlock.plant import layout as L
from fluxlock.plant.magnetics import FluxMap, axes_matrix, rotor_axes
from tests.plant.circuits import random_gates, random_saturated
from tests.plant.test_circuits import COUPLED_LIMIT, IMPOSED_LIMIT, VOLTAGE_LIMIT, Comparison
from tests.plant.test_energy import ELECTRICAL_LIMIT, electrical_remainder
from tests.plant.test_salient import ipm

L_D_H, L_Q_H = 11.8e-3, 13.7e-3
CURVE = (0.018, -0.025, 0.0, -0.0015)
SATURATION = SaturationParams(5.0, -0.10, 0.05, CURVE, 5.0)
YU = MachineParams(
    9,
    (0.5,) * 5,
    (L_D_H,) * 5,
    (0.098,) * 5,
    l_q_h=L_Q_H,
    phases=5,
    third=ThirdParams(2e-3, 2e-3),
    saturation=SATURATION,
)


def yu_map(**changes: object) -> FluxMap:
    return FluxMap(dataclasses.replace(YU, saturation=dataclasses.replace(SATURATION, **changes)))  # type: ignore[arg-type]


# ---- what the file states is what the machine does


@pytest.mark.parametrize(("plus", "minus"), [(-0.10, 0.05), (-0.03, 0.0), (-0.03, 0.015), (0.0, 0.0)])
def test_d_axis(plus: float, minus: float) -> None:
    """The incremental L_d has its stated values at no current and at plus and minus the stated one.

    Verifies: PLANT-23
    """
    flux = yu_map(plus=plus, minus=minus)
    for i_d, share in ((0.0, 0.0), (5.0, plus), (-5.0, minus)):
        l_d = flux.inductance([i_d, 0.0, 0.0, 0.0])[0, 0]
        assert l_d == pytest.approx(L_D_H * (1.0 + share), rel=1e-12)


def test_cross_curve() -> None:
    """Half of atan(2 L_dq / (L_q - L_d)) follows the stated curve within 1e-5 rad up to 5 A; beyond, L_dq levels out.

    Verifies: PLANT-23
    """
    flux = yu_map(plus=0.0, minus=0.0)
    i_q = np.linspace(-5.0, 5.0, 2001)
    i = np.zeros((i_q.size, 4))
    i[:, 1] = i_q
    l_now = flux.inductance(i)
    angle = 0.5 * np.arctan(2.0 * l_now[:, 0, 1] / (l_now[:, 1, 1] - l_now[:, 0, 0]))
    stated = -0.0015 * i_q**3 - 0.025 * i_q + 0.018
    assert np.abs(angle - stated).max() <= 1e-5
    far = flux.inductance([[0.0, q, 0.0, 0.0] for q in (10.0, 11.0, 100.0, -10.0, -100.0)])[:, 0, 1]
    assert far[0] == far[1] == far[2] and far[3] == far[4]
    assert 1e-4 < abs(far[0]) < 3e-3


def test_coenergy() -> None:
    """Incremental inductances are the derivatives of the flux linkages, and symmetric: there is one co-energy.

    Verifies: PLANT-23
    """
    seed = 20262
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    flux, step = FluxMap(YU), 1e-4
    for _ in range(200):
        i = rng.uniform(-14, 14, 4)
        l_now = flux.inductance(i)
        slope = np.array([(flux.flux(i + e) - flux.flux(i - e)) / (2 * step) for e in step * np.eye(4)])
        assert slope == pytest.approx(l_now, abs=2e-8)
        assert (l_now == l_now.T).all() and np.linalg.eigvalsh(l_now).min() > 0.0
    # The energy of two paths to the same currents: along a ray, and one axis after the other.
    end = np.array([4.0, -6.0, 1.0, 2.0])
    work, at, nodes = 0.0, np.zeros(4), np.polynomial.legendre.leggauss(40)
    for axis in range(4):
        for piece in range(64):
            for x, weight in zip(*nodes, strict=True):
                i = at.copy()
                i[axis] = end[axis] * (piece + 0.5 * (x + 1.0)) / 64
                work += 0.5 * weight * end[axis] / 64 * float(i @ flux.inductance(i)[:, axis])
        at[axis] = end[axis]
    assert flux.energy(end) == pytest.approx(2.5 * work, rel=1e-7)


@pytest.mark.parametrize("mode", ["py", "jit"])
def test_kernel_has_the_same_machine(mode: str) -> None:
    """Flux linkages, inductances and torque of the kernel are those of the map, at any currents and edges of pieces.

    Verifies: PLANT-23
    """
    rng = np.random.default_rng(1)
    params = dataclasses.replace(random_saturated(rng, five=True), machine=YU)
    flux = FluxMap(YU)
    plant = Plant(params, seed=1, mode=mode)
    theta = plant.theta_e_rad
    axes = axes_matrix(theta, 5)
    cases = [*rng.uniform(-14, 14, (60, 4)), *([1.0, float(q), 0.5, 0.2] for q in flux.edges), np.zeros(4)]
    for i in cases:
        plant.state[L.I : L.I + 5] = np.asarray(i) @ axes
        plant.inject_fault("clear")  # has the machine look at its currents
        wanted = flux.flux(i)
        assert plant.state[L.FLUX : L.FLUX + 4] == pytest.approx(wanted, rel=1e-11, abs=1e-13)
        l_now = plant.state[L.LM : L.LM + 25].reshape(5, 5)
        seen = np.array([rotor_axes(theta, 5, row) for row in axes @ l_now])  # 2/5 axes L axes'
        assert seen == pytest.approx(flux.inductance(i), rel=1e-9, abs=1e-11)
        torque = wanted[0] * i[1] - wanted[1] * i[0] + 3 * (wanted[2] * i[3] - wanted[3] * i[2])
        assert plant.torque_nm == pytest.approx(22.5 * torque, rel=1e-9, abs=1e-11)


# ---- against the independent integration


def saturated(rng: np.random.Generator, mechanics: str, pole_s: float, five: bool) -> PlantParams:
    return random_saturated(rng, mechanics, pole_s, five)


@pytest.mark.parametrize("five", [False, True])
def test_imposed_speed(five: bool) -> None:
    """Two random circuits of three and of five phases: diodes, dead time, floating legs.

    Verifies: PLANT-23
    """
    for seed in range(8000, 8002):
        c = Comparison(seed, "imposed", duration=100_000, salient=five, make=saturated, rtol=1e-9)
        where = f"seed {seed}: {c.params}"
        print(f"seed {seed}: {c.rows} gate changes, current error / peak {c.current / max(c.peak, 1e-9):.1e}")
        assert c.current <= IMPOSED_LIMIT * c.peak, where
        assert c.terminal <= VOLTAGE_LIMIT, where
        assert c.peak > 0.0, where


def test_free_rotor() -> None:
    """A free rotor under the torque of a saturated machine.

    Verifies: PLANT-23
    """
    c = Comparison(8100, "free", duration=100_000, salient=True, make=saturated, rtol=1e-9)
    assert c.current <= COUPLED_LIMIT * c.peak and c.speed <= COUPLED_LIMIT


@pytest.mark.parametrize("five", [False, True])
def test_energy(five: bool) -> None:
    """Supply energy = losses + magnetic + shaft energy over random circuits whose currents pass many pieces.

    Verifies: PLANT-23
    """
    passed = 0
    for seed in range(8200, 8220):
        rng = np.random.default_rng(seed)
        plant = Plant(random_saturated(rng, "imposed", five=five), seed=seed)
        start = plant.energies_j()
        pieces = set()
        for t, gates in random_gates(rng, 200_000, 5 if five else 3):
            plant.step(t, gates, 2)
            pieces.add(plant.state[L.PIECE])
        remainder = electrical_remainder(start, plant.energies_j())
        assert abs(remainder) <= ELECTRICAL_LIMIT, f"seed {seed}"
        passed += len(pieces) > 3
    assert passed >= 10, "currents that stay in a piece show nothing"


def test_steps_do_not_matter() -> None:
    """Between events the solution is exact: more steps change nothing but rounding.

    Verifies: PLANT-23
    """
    rng = np.random.default_rng(8300)
    params = random_saturated(rng, "imposed", five=True)
    rows = [row for row in random_gates(rng, 200_000, 5)]
    ends = []
    for parts in (1, 7):
        plant = Plant(params, seed=1)
        for (t, gates), (after, _) in itertools.pairwise(rows):
            plant.step(t, gates, 2)
            for k in range(1, parts):
                plant.advance(t + (after - t) * k // parts)
        plant.advance(rows[-1][0])
        ends.append(plant.currents_a)
    peak = np.abs(ends[0]).max()
    assert peak > 0.0
    assert np.abs(ends[1] - ends[0]).max() <= 1e-9 * peak


# ---- the rest


def test_three_phases_without_saturation() -> None:
    """With no change of L_d and a curve of zero the saturated machine is the salient one.

    Verifies: PLANT-23
    """
    plants = [
        Plant(ipm(machine__saturation=s), seed=1) for s in (None, SaturationParams(20.0), SaturationParams(20.0, -0.3))
    ]
    rng = np.random.default_rng(3)
    largest = different = 0.0
    for t, gates in random_gates(rng, 60_000):
        for plant in plants:
            plant.step(t, gates, t % 2)
        plain, same, other = (plant.currents_a for plant in plants)
        largest, different = max(largest, np.abs(plain).max()), max(different, np.abs(other - plain).max())
        assert same == pytest.approx(plain, abs=1e-8)
    assert largest > 1.0 and different > 1e-2


def test_identical_bits() -> None:
    """Plain Python and compiled code agree.

    Verifies: PLANT-06, PLANT-23
    """
    for seed, five in ((0, False), (1, True)):
        rng = np.random.default_rng(seed)
        params = random_saturated(rng, "free", five=five)
        plants = [Plant(params, seed=seed, mode=mode) for mode in ("py", "jit")]
        for t, gates in random_gates(rng, 30_000, 5 if five else 3):
            for plant in plants:
                plant.step(t, gates, t % 2)
        assert plants[0].state.tobytes() == plants[1].state.tobytes(), f"seed {seed}"


def test_phase_opens() -> None:
    """The others keep their flux linkages but for the star's impulse, in a saturated machine too.

    Verifies: PLANT-22, PLANT-23
    """
    rng = np.random.default_rng(2)
    plant = Plant(dataclasses.replace(random_saturated(rng, five=True), machine=YU), seed=1, mode="py")
    axes = axes_matrix(plant.theta_e_rad, 5)
    plant.state[L.I : L.I + 5] = np.array([4.0, -5.0, 0.5, -0.7]) @ axes
    plant.inject_fault("clear")
    before = plant.state[L.FLUX : L.FLUX + 4] @ axes
    plant.inject_fault("open_phase", phases=(1,))
    i = plant.currents_a
    change = (FluxMap(YU).flux(rotor_axes(plant.theta_e_rad, 5, i)) @ axes - before)[[0, 2, 3, 4]]
    assert i[1] == 0.0 and abs(i.sum()) <= 1e-12
    assert np.ptp(change) <= 1e-12


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"current_a": 0.0}, "current_a = 0.0: must be above 0"),
        ({"plus": -0.95}, "plus = -0.95: must be between -0.9 and 0.9"),
        ({"angle_rad": (0.0, 0.2, 0.0, 0.0)}, "angle_rad = .*: must be within ±0.7 rad up to angle_current_a"),
        ({"angle_rad": (0.0, 0.0)}, r"angle_rad = \(0.0, 0.0\): must be 4 values"),
        ({"current_a": 60.0}, "third, saturation = 'least incremental .*: must be positive definite at any current"),
    ],
)
def test_refused(changes: dict[str, object], message: str) -> None:
    """Saturation that no machine has is named.

    Verifies: PLANT-13, PLANT-23
    """
    with pytest.raises(ValueError, match=message):
        dataclasses.replace(YU, saturation=dataclasses.replace(SATURATION, **changes))  # type: ignore[arg-type]


def test_unequal_phases_are_refused() -> None:
    """Saturation needs equal phases and a sinusoidal EMF.

    Verifies: PLANT-13, PLANT-23
    """
    with pytest.raises(ValueError, match=r"psi_vs = .*: must be equal for all phases"):
        ipm(machine__saturation=SaturationParams(20.0, -0.1), machine__psi_vs=(1e-3, 1e-3, 2e-3))
    with pytest.raises(ValueError, match=r"emf = 'trapezoidal': must be sinusoidal with 5 phases or saturation"):
        ipm(machine__saturation=SaturationParams(20.0, -0.1), machine__emf="trapezoidal")
    assert math.isfinite(ipm(machine__saturation=SaturationParams(20.0, -0.1, 0.05)).machine.l_h[0])
