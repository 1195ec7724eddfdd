# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A vector scenario played on the native twin: events, windows, verdict, and what it refuses."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from fluxlock.base.paths import ROOT
from fluxlock.config import ConfigError, load_scenario
from fluxlock.native.player import player
from fluxlock.results.metrics import run_metrics

VECTOR = ROOT / "scenarios" / "vector"
START = VECTOR / "start.toml"
CAUGHT = (
    "duration_s=0.30",
    "initial.speed_rpm=40000",
    'event=[{at_s=0.003, speed_rpm=40000}, {at_s=0.004, command="start"}, {at_s=0.14, load_factor=4.0}]',
    'window=[{name="before", from_s=0.12, to_s=0.14}, {name="after", from_s=0.28, to_s=0.30}]',
    'expect=[{window="after", metric="angle_error_deg.rms", max=1.0}]',
)


def command(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "fluxlock", "native", str(START), *words], capture_output=True, text=True, check=False
    )


def test_scenario_is_played(tmp_path: Path) -> None:
    """Events and limits of a vector scenario count: verdict, result and trace as of a run; a missed limit fails.

    Verifies: VC-35
    """
    sets = [word for line in CAUGHT for word in ("--set", line)]
    done = command("--play", "--out", str(tmp_path), *sets)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("ok: ") and "1 limits kept" in done.stdout.splitlines()[0]
    result = json.loads((tmp_path / "result.json").read_text())
    assert result["verdict"]["passed"] and (tmp_path / "trace.npz").exists()
    missed = command("--play", "--out", str(tmp_path), *sets, "--set", "expect[0].max=0.0001")
    assert missed.returncode == 1 and "failed: after: angle_error_deg.rms is" in missed.stderr


def test_load_step() -> None:
    """The fan's fourfold torque at the same speed takes the current of its balance with the torque.

    Verifies: VC-35
    """
    scenario = load_scenario(START, CAUGHT)
    _, metrics = run_metrics(player(scenario, 1).run(), scenario)
    per_ampere = 1.5 * scenario.motor.pole_pairs * np.mean(scenario.motor.psi_vs)
    for window, factor in (("before", 1.0), ("after", 4.0)):
        found = metrics[window]
        balance_a = factor * scenario.shaft_load.torque_nm(found["speed_rpm"]["mean"]) / per_ampere
        assert found["iq_a"] == pytest.approx(balance_a, abs=0.3), window
        assert abs(found["id_a"]) < 0.1


def test_same_seed_same_run() -> None:
    """The noise comes from the seed alone.

    Verifies: VC-35
    """
    scenario = load_scenario(START, CAUGHT)
    first, again, other = (player(scenario, seed).run() for seed in (1, 1, 2))
    assert np.array_equal(first.records, again.records)
    assert not np.array_equal(first.records, other.records)


@pytest.mark.parametrize(
    ("scenario", "sets", "texts"),
    [
        ("vector/ipm-injection.toml", ("inverter.supply_diode=true",), ["inverter.supply_diode"]),
        ("six-step/hall.toml", (), ["drive.hall.mode"]),
        ("demo.toml", ("inverter.supply_diode=true",), ["inverter.supply_diode"]),
        ("demo.toml", ('expect=[{window="steady", metric="freewheel_deg.max", max=30.0}]',), ["expect[0].metric"]),
        ("vector/start.toml", ("drive.vector.dead_time_compensation=false",), ["dead_time_compensation"]),
        (
            "vector/start.toml",
            ('event=[{at_s=0.1, fault={kind="stuck_high", phases=["A"]}}]', "window=[]", "expect=[]"),
            ["event[0].fault"],
        ),
    ],
)
def test_refused_by_name(scenario: str, sets: tuple[str, ...], texts: list[str]) -> None:
    """What the twin is not, is named with its key.

    Verifies: VC-35
    """
    loaded = load_scenario(ROOT / "scenarios" / scenario, sets)
    with pytest.raises(ConfigError) as error:
        player(loaded, 1)
    problems = [str(problem) for problem in error.value.problems]
    assert len(problems) == len(texts)
    # A key of a motor file is named without `motor.`.
    assert all(text.removeprefix("motor.") in problem for text, problem in zip(texts, problems, strict=True)), problems


@pytest.mark.parametrize(
    ("words", "text"),
    [
        ((), "drive.method: without --play the motor is driven in six steps only"),
        (("--out", "build/x"), "error: --out: build/x: needs --play"),
        (("--play", "--seconds", "1"), "error: --play: ends with the scenario and keeps no memory"),
    ],
)
def test_options_that_do_not_fit(words: tuple[str, ...], text: str) -> None:
    """One line, exit code 2.

    Verifies: VC-35
    """
    done = command(*words)
    assert done.returncode == 2 and text in done.stderr, done.stderr


def test_six_step_scenario_is_played(tmp_path: Path) -> None:
    """Events, windows and limits of a six-step scenario count; a missed limit fails.

    Verifies: POP-06
    """
    call = [sys.executable, "-m", "fluxlock", "native", str(ROOT / "scenarios" / "demo.toml"), "--play"]
    done = subprocess.run([*call, "--out", str(tmp_path)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    result = json.loads((tmp_path / "result.json").read_text())
    assert result["verdict"]["passed"] and len(result["expectations"]) == 10
    assert result["metrics"]["steady"]["commutation_error_deg"]["rms"] < 0.3
    limit = 'expect=[{window="steady", metric="speed_rpm.mean", max=59000.0}]'
    missed = subprocess.run(
        [*call, "--out", str(tmp_path), "--set", limit], capture_output=True, text=True, check=False
    )
    assert missed.returncode == 1 and "failed: steady: speed_rpm.mean is" in missed.stderr
