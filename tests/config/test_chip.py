"""Which build of the chip a scenario runs on."""

from __future__ import annotations

import pytest

from fluxlock.config import load_scenario
from fluxlock.cosim import run
from fluxlock.paths import ROOT


@pytest.mark.parametrize(
    ("name", "phases", "injection"),
    [("demo", 3, False), ("vector/start", 3, False), ("vector/ipm-injection", 3, True), ("five-phase/yu", 5, True)],
)
def test_chip_of_a_scenario(name: str, phases: int, injection: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Phases of the motor, injection path of the drive.

    Verifies: SOC-28
    """
    monkeypatch.setattr(run, "ready_chip", lambda *arguments: arguments)
    scenario = load_scenario(ROOT / "scenarios" / f"{name}.toml")
    assert run.chip_of(scenario, True) == (True, phases, injection)
