# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A regression row and a figure fail by name when one of their runs cannot be vouched for."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from matplotlib.figure import Figure

import fluxverify.regression.sets  # noqa: F401  # registers all cases before the test adds its own
from fluxlock.config import Scenario
from fluxlock.cosim.outcome import write_outcome
from fluxverify.figures import FIGURES, Drawing, Entry
from fluxverify.figures import command as figures
from fluxverify.figures.figure import FigureEntry
from fluxverify.regression import run as regression_run
from fluxverify.regression import runner
from fluxverify.regression.case import CASES, Case, Row
from fluxverify.regression.runner import Runner
from tests.results.test_verdict import BASE, CURRENT, RUNNING, run

SLOW = r"5500\.0 r/min for 6000 r/min in steady .*limit current active"


@pytest.fixture
def simulator(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Every run gives a rotor that is too slow because of the current limit."""
    slow = run(speed_rpm=5_500.0, account=((0.0, RUNNING, CURRENT),))
    monkeypatch.setattr(runner, "FOLDER", tmp_path)
    monkeypatch.setattr(runner, "KEYS", tmp_path / "keys")

    def simulate(loaded: Scenario, *, folder: Path, seed: int, plots: bool) -> None:
        write_outcome(slow, loaded, folder, plots)

    monkeypatch.setattr(runner, "simulate", simulate)
    monkeypatch.setattr(runner, "image_of", lambda loaded: Path(__file__))
    monkeypatch.setattr(runner, "_key", lambda loaded, seed, image: "key")


def _case(accept: dict[str, str]) -> Any:
    def body(of: Runner) -> Iterator[Row]:
        of.drive("demo.toml", "slow", *BASE, accept=accept)
        yield Row("vouched/row", {}, {"x": 1}, {"x": (1, 1)})

    return body


@pytest.mark.parametrize(("accept", "passed"), [({}, False), ({"current": "its load asks for more"}, True)])
def test_rows(simulator: None, monkeypatch: pytest.MonkeyPatch, accept: dict[str, str], passed: bool) -> None:
    """Its own limits are kept, yet the case has a row that fails with the run's name and cause, unless it expects that.

    Verifies: FRONT-37
    """
    monkeypatch.setitem(CASES, "vouched", Case("vouched", _case(accept)))
    first, *others = regression_run._rows("vouched", False, 1)
    assert first["id"] == "vouched/row" and first["pass"]
    if passed:
        assert others == []
        return
    (row,) = others
    assert row["id"] == "vouched/vouched" and not row["pass"]
    assert re.match(f"slow: {SLOW}", row["note"]), row["note"]


@pytest.mark.parametrize(("accept", "failure"), [({}, "not vouched for: slow: 5500.0 r/min"), ({"speed": "why"}, "")])
def test_figures(
    simulator: None, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, accept: dict[str, str], failure: str
) -> None:
    """The figure is drawn and fails with the run's name and cause, unless it expects that.

    Verifies: FRONT-37
    """

    def body(of: Runner) -> Drawing:
        """A figure."""
        of.drive("demo.toml", "slow", *BASE, accept=accept)
        return Drawing("condition", Figure(), (Entry("speed", "", "5500", "drive", None),))

    monkeypatch.setitem(FIGURES, "six-step/1.9", FigureEntry("six-step", "1.9", body))
    part = figures.draw("six-step", tmp_path, "1.9", False, 1)
    assert (tmp_path / part["image"]).is_file()
    assert part["failure"].startswith(failure) and bool(part["failure"]) is bool(failure)
