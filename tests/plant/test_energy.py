# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Energy balance over random circuits."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from fluxlock.plant import Plant
from tests.plant.circuits import random_gates, random_params

ELECTRICAL_LIMIT = 1e-8  # of the energy that passed through
MECHANICAL_LIMIT = 1e-3  # second-order splitting, circuits whose speed changes by tens of per cent


def electrical_remainder(start: dict[str, float], end: dict[str, float]) -> float:
    """What is missing in the electrical balance, relative to the energy that passed through."""
    lost = [end[k] for k in ("source_resistance", "copper", "switches", "diodes", "chopper")]
    assert min(lost) >= 0.0
    stored = sum(end[k] - start[k] for k in ("magnetic_now", "capacitor_now"))
    remainder = end["supply"] - sum(lost) - end["shaft"] - stored
    return remainder / (abs(end["supply"]) + sum(lost) + abs(end["shaft"]) + 1e-30)


def balance(seed: int, mechanics: str) -> tuple[float, float]:
    """Electrical and mechanical remainder, relative to the energy that passed through."""
    rng = np.random.default_rng(seed)
    params = random_params(rng, mechanics)
    rows = random_gates(rng, 400_000)
    plant = Plant(params, seed=seed, mode="jit")
    start = plant.energies_j()
    for t, gates in rows:
        plant.step(t, gates, 2)
    e = plant.energies_j()
    mechanical = e["shaft"] - e["load"] - (e["kinetic_now"] - start["kinetic_now"])
    return electrical_remainder(start, e), mechanical / (abs(e["shaft"]) + abs(e["load"]) + 1e-30)


@pytest.mark.parametrize("batch", range(4))
def test_balance(batch: int) -> None:
    """Supply energy = losses + magnetic + capacitor + shaft energy; shaft energy = load + kinetic.

    Verifies: PLANT-05
    """
    for seed in range(25 * batch, 25 * batch + 25):
        electrical, _ = balance(seed, "imposed")
        assert abs(electrical) <= ELECTRICAL_LIMIT, f"seed {seed}, imposed"
        electrical, mechanical = balance(seed, "free")
        assert abs(electrical) <= ELECTRICAL_LIMIT, f"seed {seed}, free"
        assert abs(mechanical) <= MECHANICAL_LIMIT, f"seed {seed}, free"


@pytest.mark.parametrize("batch", range(4))
def test_degenerate_circuits(batch: int) -> None:
    """No fault, no rest current, balanced energy with ideal switches and diodes, or a link of 100 nF.

    Verifies: PLANT-02, PLANT-05
    """
    for seed in range(5000 + 100 * batch, 5100 + 100 * batch):
        rng = np.random.default_rng(seed)
        params = random_params(rng, "imposed")
        inverter = params.inverter
        if seed % 2:
            inverter = dataclasses.replace(inverter, diode_drop_v=0.0, diode_r_ohm=0.0, r_on_ohm=0.0)
        if inverter.dc_link_c_f > 0.0:
            inverter = dataclasses.replace(inverter, dc_link_c_f=1e-7)
        plant = Plant(dataclasses.replace(params, inverter=inverter), seed=seed, mode="jit")
        start = plant.energies_j()
        for t, gates in random_gates(rng, 200_000):
            plant.step(t, gates, 2)
            currents = plant.currents_a
            assert abs(currents.sum()) <= 1e-14 * np.abs(currents).max(), f"seed {seed}"
        assert abs(electrical_remainder(start, plant.energies_j())) <= ELECTRICAL_LIMIT, f"seed {seed}"
