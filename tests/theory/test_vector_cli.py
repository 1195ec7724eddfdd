# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The commands of the vector theory: tables, files, bad input."""

from __future__ import annotations

import json
import re
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from fluxlock import cli
from fluxlock.base.paths import ROOT
from fluxlock.theory.vector import study
from fluxlock.theory.vector.cli import app
from fluxlock.theory.vector.study import Bench
from tests.theory.test_vector_controllers import PEAKS
from tests.theory.test_vector_observer import PRINTED
from tests.theory.vector_machines import MOTOR_1

RUNNER = CliRunner(env={"COLUMNS": "160"})
PUMP = str(ROOT / "motors" / "pump-4pp.toml")


def table(*arguments: str) -> list[list[str]]:
    """Cells of all rows that a command prints."""
    result = RUNNER.invoke(app, list(arguments), catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return [[c.strip() for c in line.strip("│").split("│")] for line in result.output.splitlines() if line[:1] == "│"]


def test_steps() -> None:
    """Every cell of the specification's table as printed, 0.1 of rounding; another machine, delay and speed.

    Verifies: VTHEORY-13
    """
    rows = table("steps")
    assert len(rows) == len(PEAKS)
    for row, ((speed, delay), printed) in zip(rows, PEAKS.items(), strict=True):
        assert (float(row[0]), float(row[1])) == (15e3 * speed, delay)
        assert [float(c) for c in row[2:5]] == pytest.approx(printed, abs=0.101)
        assert int(row[10]) <= 7
    (row,) = table("steps", PUMP, "--rate", "10000", "--speed", "-300", "--delay", "1", "--park", "exact")
    assert row[0] == "-300" and row[4] == "0.0"
    # Twice as fast as in the table A is unstable.
    (row,) = table("steps", "--speed", "3000", "--delay", "1")
    assert row[2] == "unstable" and row[8] == f"> {study.FOLLOWED}"


def test_bandwidth() -> None:
    """More delay, less bandwidth and margin.

    Verifies: VTHEORY-13
    """
    rows = [[float(c) for c in row] for row in table("bandwidth", "--gamma", "0.35")]
    assert [row[0] for row in rows] == [0.08, 0.25, 0.5, 1.0] and rows[0][2] > 5000
    assert all(a[2] > b[2] and a[4] > b[4] for a, b in pairwise(rows))


def test_observer() -> None:
    """The twelve cells, closed form and simulated.

    Verifies: VTHEORY-13
    """
    rows = table("observer", "--speed", "1500")
    assert len(rows) == 2
    for row in rows:
        assert [float(c) for c in row[2:]] == pytest.approx(PRINTED[1500.0], abs=0.011)


def test_pll() -> None:
    """Gains of both orders, wrong sign unstable, limits by the observer's poles.

    Verifies: VTHEORY-13
    """
    rows = table("pll", "--speed", "-750")
    assert [row[0] for row in rows[:2]] == ["2", "3"] and all(float(r[4]) < 1 < float(r[5]) for r in rows[:2])
    assert float(rows[2][3]) > float(rows[3][3]) and rows[2][2] == "> 3000"


def test_parameters(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Map with PNG and JSON, worst case.

    Verifies: VTHEORY-13
    """
    rows = table("parameters", "--out", str(tmp_path), "--speed-max", "900", "--current-max", "20")
    by_name = {row[0]: row for row in rows}
    assert float(by_name["L -30 %"][2]) == float(by_name["L -30 %"][3]) == pytest.approx(-7.6, abs=0.1)
    assert (tmp_path / "parameters.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    data = json.loads((tmp_path / "parameters.json").read_text())
    assert data["speed_hz"][-1] == 900 and data["load_a"][-1] == 20
    largest = max(np.abs(np.array(m, dtype=float)).max() for m in data["error_deg"].values())
    assert abs(data["worst_deg"]) == pytest.approx(largest)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["vector", "steps", "--speed", "0"], "--speed: 0: is not possible; permitted above 0 to 3750 Hz"),
        (["vector", "observer", "--speed", "-4000"], "--speed: -4000"),
        (["vector", "bandwidth", "--speed", "100", "--speed", "200"], "--speed: this table is for one speed"),
        (["vector", "steps", "--delay", "1.5"], "--delay"),
        (["vector", "steps", "no.toml"], "no.toml"),
        (["vector", "pll", "--loop", "4000"], "--loop: 4000: is too fast; permitted to 3000 Hz"),
        (["vector", "parameters", "--speed-max", "5000"], "--speed-max: 5000 Hz is above 3750 Hz"),
        (["vector", "parameters", "--out", "README.md"], "--out"),
        (["vector", "parameters", "--loop", "1e5"], "--loop"),
        (["vector", "stepps"], "stepps"),
    ],
)
def test_bad_input(
    arguments: list[str], message: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """One line that names the option, exit code 2.

    Verifies: VTHEORY-13
    """
    monkeypatch.chdir(ROOT)
    monkeypatch.setattr(sys, "argv", ["fluxlock", *arguments])
    with pytest.raises(SystemExit) as caught:
        cli.main()
    err = re.sub(r"\s+", " ", capsys.readouterr().err.strip())
    assert caught.value.code == 2 and message in err, err


def test_unsettled_step() -> None:
    """A stable loop that needs longer than it is followed has no settling time, but a peak.

    Verifies: VTHEORY-13
    """
    slow = study.steps(Bench(MOTOR_1, 15e3), (0.12,), (1.0,))[0]
    assert slow.kind == "A" and slow.settling == -1 and slow.peak_percent > 90
