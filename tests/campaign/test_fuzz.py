"""Random register accesses on the running chip: gates stay safe, the bus answers."""

from __future__ import annotations

import pytest

from fluxlock.campaign.fuzz import fuzz
from fluxlock.config import load_scenario
from fluxlock.paths import ROOT

COPIES, SPAN_S = 10, 0.003
SEED = 1


@pytest.mark.parametrize(("name", "at_s"), [("six-step", 0.020), ("vector", 0.030)])
def test_random_accesses(name: str, at_s: float) -> None:
    """Words, halves and bytes at random places and times, while six-step or vector control drives the machine.

    Verifies: SAFE-16
    """
    scenario = f"campaign/{name}.toml"
    dead_time_s = load_scenario(ROOT / "scenarios" / scenario).inverter.dead_time_s
    runs = fuzz(scenario, at_s, SEED, COPIES, SPAN_S)
    for run in runs:
        print(f"seed {SEED}: {run}")
    assert sum(run.accesses for run in runs) > 20 * COPIES
    assert sum(run.gate_changes for run in runs) > 50 * COPIES, "the gates were off"
    for run in runs:
        assert run.shoot_throughs == 0, run
        assert run.least_dead_time_s is None or run.least_dead_time_s >= dead_time_s - 1e-9, run
        assert run.alive, run
