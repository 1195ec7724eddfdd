# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Feasible injection frequencies by Tian's rule, and the command that prints them."""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from fluxlock import cli
from fluxlock.base.paths import ROOT
from fluxlock.config import load_motor
from fluxlock.theory.injection.frequency import ANGLE_ERROR_RAD, INDUCTANCE_ERROR, Rule, bound_map, feasible

TIAN = load_motor(ROOT / "motors" / "five-phase-tian.toml")
RUNNER = CliRunner(env={"COLUMNS": "160"})


def main(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> int:
    monkeypatch.setattr(sys, "argv", ["fluxlock", "injection", *arguments])
    with pytest.raises(SystemExit) as end:
        cli.main()
    return int(end.value.code or 0)


def test_the_papers_machine() -> None:
    """249 Hz nominal, 281 Hz strict: the paper's own n = 40 is accepted by the one, rejected by the other.

    Verifies: INJT-01
    """
    rule = Rule.from_motor(TIAN)
    found = feasible(rule, 10_300.0, 100.0, TIAN.pole_pairs)
    assert found.nominal_hz == pytest.approx(10 * 1.3 / 8.32e-3 / (2 * math.pi), rel=1e-12)
    assert (round(found.nominal_hz), round(found.strict_hz)) == (249, 281)
    of_n = {c.n: c for c in found.choices}
    assert of_n[40].nominal and not of_n[40].strict and of_n[40].hz == 257.5
    assert (found.largest_n(strict=True), found.largest_n(strict=False)) == (36, 41)
    assert of_n[36].strict and not of_n[37].strict and not of_n[42].nominal


def test_strict_bound_is_the_largest() -> None:
    """Random inductances, speeds and angles within the errors stay below it and come near it.

    Verifies: INJT-01
    """
    rule, rng = Rule.from_motor(TIAN), np.random.default_rng(5)
    top = TIAN.omega_e(100.0)
    d, q = 1 + INDUCTANCE_ERROR * rng.uniform(-1, 1, (2, 200_000))
    w, e = top * rng.uniform(-1, 1, 200_000), ANGLE_ERROR_RAD * rng.uniform(-1, 1, 200_000)
    l_d, l_q = d * rule.ld_h, q * rule.lq_h
    bound = 10 * abs(0.5 * w * (l_q - l_d) * np.sin(2 * e) + rule.r_ohm)
    bound = bound / (0.5 * (l_d + l_q + (l_q - l_d) * np.cos(2 * e))) / (2 * math.pi)
    strict = rule.strict_bound_hz(top)
    assert 0.98 * strict < bound.max() <= strict
    # At high speed ten times the speed decides.
    assert rule.strict_bound_hz(1e4) == rule.nominal_bound_hz(1e4) == pytest.approx(1e5 / (2 * math.pi))


def test_map() -> None:
    """The map holds the bounds at its centre and corners.

    Verifies: INJT-01
    """
    rule, top = Rule.from_motor(TIAN), TIAN.omega_e(100.0)
    found = bound_map(rule, top)
    assert found.bound_hz[30, 30] == pytest.approx(rule.nominal_bound_hz(top))
    assert found.bound_hz[0].max() == pytest.approx(rule.strict_bound_hz(top))
    assert found.bound_hz.argmax() == 60 and found.bound_hz.argmin() < 61 * 61


def test_command(tmp_path: Path) -> None:
    """Table with both columns, JSON and PNG; the three-phase machine too.

    Verifies: INJT-02
    """
    for file, options, n_nominal in (
        ("five-phase-tian", [], 41),
        ("ipm-4pp", ["--carrier-hz", "20000", "--speed-rpm", "400"], 41),
    ):
        motor = str(ROOT / "motors" / f"{file}.toml")
        result = RUNNER.invoke(cli.app, ["injection", motor, *options, "--out", str(tmp_path)], catch_exceptions=False)
        assert result.exit_code == 0, result.output
        assert f"largest n: {n_nominal} nominal" in result.output
        data = json.loads((tmp_path / "injection.json").read_text())
        assert np.shape(data["map"]["bound_hz"]) == (61, 61)
        assert max(c["n"] for c in data["choices"] if c["nominal"]) == n_nominal
        assert (tmp_path / "injection.png").stat().st_size > 10_000
        if file == "five-phase-tian":
            (row,) = (line for line in result.output.splitlines() if "257.5" in line)
            assert [c.strip() for c in row.strip("│").split("│")] == ["40", "257.5", "yes", "no", "40 / 80"]
            assert [
                c.strip() for line in result.output.splitlines() if "…" in line for c in line.strip("│").split("│")
            ] == (["…"] * 5), "one row stands for those that are left out"


@pytest.mark.parametrize(
    ("text", "replaced", "message"),
    [
        ("inductance_q_h = 8.32e-3\n", "", "inductance_q_h is missing"),
        ("inductance_q_h = 8.32e-3", "inductance_q_h = 6.6e-3", "less than 2 %"),
        ("inductance_q_h = 8.32e-3", "inductance_q_h = 5e-3", "follow the q axis"),
    ],
)
def test_machines_without_saliency(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    text: str,
    replaced: str,
    message: str,
) -> None:
    """One line that says why, exit code 2.

    Verifies: INJT-02
    """
    file = tmp_path / "motor.toml"
    source = (ROOT / "motors" / "five-phase-tian.toml").read_text(encoding="utf-8")
    assert text in source
    file.write_text(source.replace(text, replaced), encoding="utf-8")
    assert main(monkeypatch, str(file), "--out", str(tmp_path / "out")) == 2
    error = capsys.readouterr().err
    assert message in error and len(error.splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_bad_options(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """A carrier below the least frequency, and a folder that cannot be made.

    Verifies: INJT-02
    """
    motor = str(ROOT / "motors" / "five-phase-tian.toml")
    assert main(monkeypatch, motor, "--carrier-hz", "200") == 2
    assert "--carrier-hz: 200 Hz is below the least injection frequency of 249 Hz" in capsys.readouterr().err
    (tmp_path / "file").write_text("")
    assert main(monkeypatch, motor, "--out", str(tmp_path / "file")) == 2
    assert "cannot be written" in capsys.readouterr().err


def test_settings_with_an_inverter(tmp_path: Path) -> None:
    """Periods of the e-bike machine: short ones run, for long ones the search has too little current.

    Verifies: INJT-02
    """
    folder = ROOT / "tests" / "injection"
    files = [str(folder / "motors" / "ebike.toml"), str(folder / "inverters" / "mosfet-48v.toml")]
    options = ["--carrier-hz", "20000", "--speed-rpm", "400", "--out", str(tmp_path)]
    result = RUNNER.invoke(cli.app, ["injection", *files, *options], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    settings = json.loads((tmp_path / "injection.json").read_text())["settings"]
    runs = {c["period"]: not c["refused"] for c in settings}
    assert runs[8] and not runs[24]
    assert all(c["loop"] <= 6.01 for c in settings)
    assert "period 24: drive.vector.injection.search_current_a: " in result.output
