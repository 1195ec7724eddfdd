"""Energy balance over random circuits."""

from __future__ import annotations

import numpy as np
import pytest

from fluxlock.plant import Plant
from tests.plant.circuits import random_gates, random_params

ELECTRICAL_LIMIT = 1e-8  # of the energy that passed through
MECHANICAL_LIMIT = 1e-3  # second-order splitting, circuits whose speed changes by tens of per cent


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
    gained = {k: e[k] - start[k] for k in ("magnetic_now", "capacitor_now", "kinetic_now")}
    lost = [e[k] for k in ("source_resistance", "copper", "switches", "diodes", "chopper")]
    assert min(lost) >= 0.0
    electrical = e["supply"] - sum(lost) - e["shaft"] - gained["magnetic_now"] - gained["capacitor_now"]
    mechanical = e["shaft"] - e["load"] - gained["kinetic_now"]
    through = abs(e["supply"]) + sum(lost) + abs(e["shaft"])
    return electrical / through, mechanical / (abs(e["shaft"]) + abs(e["load"]) + 1e-30)


@pytest.mark.parametrize("batch", range(4))
def test_balance(batch: int) -> None:
    """Supply energy = copper + switches + diodes + source + chopper + magnetic + capacitor + shaft; shaft = load + kinetic.

    Verifies: PLANT-05
    """
    for seed in range(25 * batch, 25 * batch + 25):
        electrical, _ = balance(seed, "imposed")
        assert abs(electrical) <= ELECTRICAL_LIMIT, f"seed {seed}, imposed"
        electrical, mechanical = balance(seed, "free")
        assert abs(electrical) <= ELECTRICAL_LIMIT, f"seed {seed}, free"
        assert abs(mechanical) <= MECHANICAL_LIMIT, f"seed {seed}, free"
