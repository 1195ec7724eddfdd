# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The circuit against an independent solution, over random circuits and switching sequences."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from fluxlock.plant import Plant, PlantParams
from fluxlock.plant import layout as L
from tests.plant.circuits import CLOCK_S, random_gates, random_params
from tests.plant.reference import DIODE_H, DIODE_L, OPEN, SWITCH_H, SWITCH_L, Reference

DURATION_CYCLES = 400_000
MODES = {OPEN: L.OPEN, SWITCH_H: L.HIGH, SWITCH_L: L.LOW, DIODE_L: L.DIODE_LOW, DIODE_H: L.DIODE_HIGH}
IMPOSED_LIMIT = 1e-6  # of peak current
COUPLED_LIMIT = 1e-4
VOLTAGE_LIMIT = 1e-5  # of the supply


def reference_of(params: PlantParams, plant: Plant, **options: object) -> Reference:
    m, n = params.mechanics, params.machine.phases
    y = np.zeros(2 * n + 4)
    y[n : n + 3] = params.inverter.supply_v, m.theta_e_rad, m.omega_m_rad_s * params.machine.pole_pairs
    y[n + 3 :] = plant.state[L.FILTERED : L.FILTERED + n + 1]
    return Reference(params, y, **options)  # type: ignore[arg-type]


class Comparison:
    """Runs plant and reference side by side and keeps the largest differences."""

    def __init__(
        self,
        seed: int,
        mechanics: str,
        duration: int = DURATION_CYCLES,
        pole_s: float = 0.0,
        salient: bool = False,
        make: Callable[..., PlantParams] = random_params,
        broken: tuple[int, ...] = (),
        **options: object,
    ) -> None:
        rng = np.random.default_rng(seed)
        self.params = make(rng, mechanics, pole_s, salient)
        rows = random_gates(rng, duration, self.params.machine.phases)
        self.plant = Plant(self.params, seed=seed, mode="jit")
        self.reference = reference_of(self.params, self.plant, broken=broken, **options)
        if broken:
            self.plant.inject_fault("open_phase", phases=broken)
        self.peak = self.current = self.link = self.terminal = self.filtered = self.speed = 0.0
        self.terminals_compared = 0
        for t, gates in rows:
            self.plant.advance(t)
            self.reference.run_to(t * CLOCK_S)
            self.look()
            self.plant.step(t, gates, 2)
            self.reference.gates = gates
        self.rows = len(rows)
        self.last_cycle = rows[-1][0]

    def look(self) -> None:
        plant, ref, supply = self.plant, self.reference, self.params.inverter.supply_v
        n = ref.n
        self.peak = max(self.peak, float(np.abs(ref.y[:n]).max()))
        self.current = max(self.current, float(np.abs(plant.currents_a - ref.y[:n]).max()))
        link = abs(float(plant.state[L.VDC]) - ref.vdc(ref.y, ref.legs))
        same_legs = [MODES[leg] for leg in ref.legs] == plant.state[L.MODE : L.MODE + n].tolist()
        if same_legs:
            self.link = max(self.link, link / supply)
            v = ref.solve(ref.y, ref.legs)[1]
            self.terminal = max(self.terminal, float(np.abs(plant.terminals_v - v).max()) / supply)
            self.terminals_compared += 1
        filtered = plant.state[L.FILTERED : L.FILTERED + n + 1] - ref.y[n + 3 :]
        self.filtered = max(self.filtered, float(np.abs(filtered).max()) / supply)
        self.speed = max(self.speed, abs(plant.omega_e_rad_s / ref.y[n + 2] - 1.0))

    def plant_events(self) -> list[tuple[float, str, int]]:
        events = self.plant.events()
        return [
            (float(e["t_cycle"]) * CLOCK_S, "off" if e["kind"] == L.EXTINCTION else "on", int(e["phase"]))
            for e in events[events["t_cycle"] < self.last_cycle]
        ]


@pytest.mark.parametrize("batch", range(12))
def test_imposed_speed(batch: int) -> None:
    """Ten random circuits each: currents, link, terminals and diode instants at imposed speed.

    Verifies: PLANT-01, PLANT-02, PLANT-03
    """
    flowing = 0
    for seed in range(10 * batch, 10 * batch + 10):
        c = Comparison(seed, "imposed")
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
    assert flowing >= 9


@pytest.mark.parametrize("batch", range(3))
def test_coupled_with_mechanics(batch: int) -> None:
    """Ten random circuits each with a free rotor under all loads.

    Verifies: PLANT-04
    """
    for seed in range(1000 + 10 * batch, 1010 + 10 * batch):
        c = Comparison(seed, "free")
        print(f"seed {seed}: current error / peak {c.current / max(c.peak, 1e-9):.1e}, speed {c.speed:.1e}")
        assert c.current <= COUPLED_LIMIT * c.peak, f"seed {seed}: {c.params}"
        assert c.speed <= COUPLED_LIMIT, f"seed {seed}: {c.params}"


@pytest.mark.parametrize("seed", range(2000, 2006))
def test_stiff_with_divider_poles(seed: int) -> None:
    """Implicit reference (Radau), divider poles far faster than the circuit.

    Verifies: PLANT-01, PLANT-07
    """
    pole_s = (1e-7, 1e-6)[seed % 2]
    c = Comparison(seed, "imposed", duration=100_000, pole_s=pole_s, method="Radau", rtol=1e-9)
    print(f"seed {seed}: divider outputs off by {c.filtered:.1e} of the supply")
    assert c.current <= IMPOSED_LIMIT * c.peak
    assert c.filtered <= 1e-6


def test_reference_disagrees_when_the_circuit_differs() -> None:
    """The comparison can fail: one per mille more inductance in one phase is seen.

    Verifies: PLANT-01
    """
    rng = np.random.default_rng(3)
    params = random_params(rng)
    rows = random_gates(rng, DURATION_CYCLES)
    plant = Plant(params, seed=3, mode="jit")
    plant.state[L.LM] *= 1.001
    reference = reference_of(params, plant)
    error = peak = 0.0
    for t, gates in rows:
        plant.advance(t)
        reference.run_to(t * CLOCK_S)
        peak = max(peak, float(np.abs(reference.y[:3]).max()))
        error = max(error, float(np.abs(plant.currents_a - reference.y[:3]).max()))
        plant.step(t, gates, 2)
        reference.gates = gates
    assert error > 10 * IMPOSED_LIMIT * peak
