# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The commands of the six-step theory: tables, files, bad input."""

from __future__ import annotations

import io
import json
import re
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from fluxlock.base.paths import ROOT
from fluxlock.config import ConfigError
from fluxlock.results.rundata import save_trace
from fluxlock.theory.six_step import soa_study
from fluxlock.theory.six_step.cli import app
from fluxlock.theory.six_step.output import plain
from tests.results.synthetic import Drive, make_run

RUNNER = CliRunner(env={"COLUMNS": "160"})
FINE, COARSE, LOAD_POINTS = (13, 12), (5, 2), 2


def run(out: Path, *arguments: str) -> tuple[str, dict]:
    """Run a command; its output and its JSON."""
    result = RUNNER.invoke(app, [*arguments, "--out", str(out)], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    png = out / f"{arguments[0]}.png"
    assert png.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    return result.output, json.loads((out / f"{arguments[0]}.json").read_text())


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(soa_study, "FINE", FINE)
    monkeypatch.setattr(soa_study, "COARSE", COARSE)
    monkeypatch.setattr(soa_study, "LOAD_POINTS", LOAD_POINTS)


def test_soa(tmp_path: Path, small: None) -> None:
    """Safe area of Motor-I: limits shrink with the speed, computed back is above seen.

    Verifies: THEORY-11
    """
    output, data = run(tmp_path, "soa", "--speed-max", "90000")
    assert "computed back" in output and "written" in output
    assert np.array(data["bound_deg"], dtype=float).shape == FINE
    for limit in data["torque_limit_nm"].values():
        assert all(a <= b + 1e-9 for a, b in zip(limit["freewheel_30_deg"], limit["computed_back"], strict=True))
    assert set(data["simulated"]) == {"ON-PWM", "PWM-ON"}
    assert data["load"]["ON-PWM"][0]["speed_rpm"] == pytest.approx(22_500)


def test_soa_gives_the_circuit_of_the_regression(tmp_path: Path, small: None) -> None:
    """The command of the page of limits gives the torques that stand in the table of the regression.

    Verifies: THEORY-11
    """
    page = (ROOT / "docs" / "theory" / "six-step-limits.md").read_text(encoding="utf-8")
    (command,) = re.findall(r"^\.venv/bin/fluxlock (soa .*)$", page, re.MULTILINE)
    words = [str(ROOT / word) if word.endswith(".toml") else word for word in command.split()]
    _, data = run(tmp_path, *words, "--speed-max", "60000")
    table = (ROOT / "docs" / "verification" / "regression.md").read_text(encoding="utf-8")
    for pattern, limit in data["torque_limit_nm"].items():
        assert limit["speed_rpm"][-1] == 60_000
        (row,) = re.findall(rf"^\| six-step/torque-limit/{pattern} \|.*", table, re.MULTILINE)
        for name, key in (("seen", "freewheel_30_deg"), ("computed_back", "computed_back")):
            assert f"circuit_{name}_mnm {1e3 * limit[key][-1]:.4g}," in row


def test_soa_of_a_slow_motor(tmp_path: Path) -> None:
    """Speeds below 12 r/min stay apart in the tables.

    Verifies: THEORY-11
    """
    output, _ = run(tmp_path, "soa", "--speed-max", "5", "--no-simulate")
    speeds = re.findall(r"^│ +([\d.]+) │", output, re.MULTILINE)
    assert len(set(speeds)) == len(speeds) == 12 and float(speeds[-1]) == 5


def test_soa_of_another_motor(tmp_path: Path, small: None) -> None:
    """A trapezoidal machine without a fan load, with its inverter; and the bound alone.

    Verifies: THEORY-11
    """
    motor = str(ROOT / "motors" / "pump-4pp.toml")
    inverter = str(ROOT / "inverters" / "drive-24v.toml")
    _, data = run(tmp_path, "soa", motor, "--inverter", inverter, "--carrier", "20000")
    assert data["settings"]["supply_v"] == 24.0
    _, data = run(tmp_path / "bound", "soa", motor, "--supply", "24", "--no-simulate")
    assert data["simulated"] == {} and data["load"] == {}


def test_stability(tmp_path: Path) -> None:
    """Map and closed form agree, also in the file.

    Verifies: THEORY-11
    """
    output, data = run(tmp_path, "stability", "--points", "21", "--sectors", "500")
    assert "27.6" in output
    assert max(data["largest_difference_deg"].values()) < 0.5
    assert len(data["map_deg"]["RSC"]) == 21


def test_spectrum(tmp_path: Path) -> None:
    """The thesis's point: N = 25/8, distortions 0.238 and 0.061.

    Verifies: THEORY-11
    """
    output, data = run(tmp_path, "spectrum")
    assert "25/8" in output and "every 0.75 f_e" in output
    spectra = data["spectra"]
    assert spectra["RSC"]["weighted_distortion"] == pytest.approx(0.238, abs=5e-4)
    assert spectra["CSC"]["weighted_distortion"] == pytest.approx(0.061, abs=5e-4)
    assert all(s["largest_difference_to_gates"] < 1e-9 for s in spectra.values())
    _, data = run(tmp_path, "spectrum", "--speed", "60000", "--no-compensate", "--mean", "0.5")
    assert data["settings"]["n"] == [10, 3] and data["spectra"]["CSC"]["duty"] == 0.5
    output, data = run(tmp_path, "spectrum", "--speed", "61234.567")
    assert "taken as" in output and data["settings"]["n"][1] <= 100
    # The ends of the permitted range belong to it.
    for speed, ratio in (("2000000", [1, 10]), ("2000", [100, 1])):
        _, data = run(tmp_path, "spectrum", "--speed", speed, "--mean", "0.5", "--no-compensate", "--max-order", "7")
        assert data["settings"]["n"] == ratio


def test_recorded(tmp_path: Path) -> None:
    """Lines of a trace file.

    Verifies: THEORY-11
    """
    made = make_run(Drive(duration_s=0.02, carrier_hz=20e3))
    made.records["torque_nm"] = 0.01 + 2e-3 * np.cos(2.0 * made.records["theta_e"])
    save_trace(tmp_path / "trace.npz", made)
    window = ("--from", "0.003", "--to", "0.015", "--commutation", "CSC")
    output, data = run(tmp_path, "recorded", str(tmp_path / "trace.npz"), *window)
    assert "series of CSC" in output
    sizes = {order: abs(complex(*a)) for order, a in zip(data["order"], data["amplitude"], strict=True)}
    series = dict(zip(data["series"]["order"], data["series"]["size"], strict=True))
    for order in (-17, -11, -5, 1, 7, 13):
        # Edges of the run are in whole clocks of 0.007 degrees.
        assert sizes[order] == pytest.approx(series[order], abs=2e-4)
    assert data["turns"] in (11, 12) and data["fundamental_hz"] == pytest.approx(1000.0, rel=1e-6)
    assert "largest torque lines" in output
    peaks = dict(zip(data["torque"]["order"], data["torque"]["peak_nm"], strict=True))
    assert max(peaks) < 6 and len(peaks) == 6 * data["turns"] - 1
    assert peaks.pop(2.0) == pytest.approx(2e-3, rel=1e-2) and max(peaks.values()) < 1e-4


def test_linearity(tmp_path: Path) -> None:
    """Errors of the mean.

    Verifies: THEORY-11
    """
    output, data = run(tmp_path, "linearity")
    assert "no compensation" in output
    low, high = data["error"]["compensated"]["min"], data["error"]["compensated"]["max"]
    assert max(np.abs([*low, *high])) < 1e-9


def npy() -> bytes:
    """One array, as `numpy.save` writes it."""
    file = io.BytesIO()
    np.save(file, np.zeros(3))
    return file.getvalue()


def npz(**arrays: np.ndarray) -> bytes:
    """Arrays that are not those of a trace."""
    file = io.BytesIO()
    np.savez(file, **arrays)
    return file.getvalue()


NO_TRACE = "is no trace of a run; name the trace.npz that fluxlock run has written$"
NOT_TRACES = {
    "text.md": b"# Title\n",
    "empty.npz": b"",
    "cut.npz": npz(log=np.zeros(100))[:200],
    "array.npy": npy(),
    "other.npz": npz(x=np.zeros(3)),
    "shape.npz": npz(**dict.fromkeys(("log", "records", "plant_events", "zoom", "clock_hz"), np.zeros(3))),
}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["soa", "missing.toml"], "missing.toml"),
        (["soa", str(ROOT / "motors" / "five-phase-yu.toml")], "phases: must be 3 for six-step operation, not 5$"),
        (["stability", "--n-min", "3", "--n-max", "2"], "--n-max"),
        (["linearity", "--n-min", "3", "--n-max", "2"], "--n-max"),
        (["spectrum", "--mean", "0"], "--mean"),
        (["spectrum", "--speed", "10"], "--carrier: with --speed gives 20000 carriers a sector, permitted 0.1 to 100$"),
        (["spectrum", "--speed", "1999999", "--carrier", "19999"], "gives 0.09999505 carriers a sector"),
        (["recorded", "missing.npz", "--from", "0", "--to", "1"], "^missing.npz: file not found$"),
        (["recorded", "DIR", "--from", "0", "--to", "1"], "is a folder, not a file"),
        *((["recorded", name, "--from", "0", "--to", "1"], NO_TRACE) for name in NOT_TRACES),
        (["recorded", "missing.npz", "--from", "1", "--to", "0.5"], "--to: must be above --from"),
        (["linearity", "--out", "FILE"], "--out"),
    ],
)
def test_bad_input(tmp_path: Path, arguments: list[str], message: str) -> None:
    """Bad values raise the error that the command line prints in one line.

    Verifies: THEORY-11
    """
    for name, content in NOT_TRACES.items():
        (tmp_path / name).write_bytes(content)
    names = {"FILE": "text.md", "DIR": ""} | {name: name for name in NOT_TRACES}
    replaced = [str(tmp_path / names[a]) if a in names else a for a in arguments]
    with pytest.raises(ConfigError, match=message):
        RUNNER.invoke(app, replaced, catch_exceptions=False)


@pytest.mark.parametrize(
    "arguments", [["soa", "--supply", "nan"], ["spectrum", "--carrier", "inf"], ["stability", "--points", "1"]]
)
def test_bad_usage(arguments: list[str]) -> None:
    """Options out of range are refused with their name.

    Verifies: THEORY-11
    """
    result = RUNNER.invoke(app, arguments)
    assert result.exit_code == 2 and arguments[1] in result.output


def test_json_numbers() -> None:
    """Arrays, complex and undefined values as JSON has them.

    Verifies: THEORY-11
    """
    values = {"a": np.array([1.0, np.inf, np.nan]), "b": np.array([1 + 2j]), 3: (np.float64(0.5), "x", True, None)}
    assert plain(values) == {"a": [1.0, None, None], "b": [[1.0, 2.0]], "3": [0.5, "x", True, None]}
