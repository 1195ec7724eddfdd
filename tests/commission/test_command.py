# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""`fluxlock identify` as a user meets it; the measurement is replaced by one of the averaged bench."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from fluxlock import cli
from fluxlock.base.paths import ROOT
from fluxlock.base.stage import ProgressInfo
from fluxlock.commission import bench as bench_module
from fluxlock.commission import command
from fluxlock.commission.protocol import MeasurementError
from fluxlock.commission.simulate import Measured, known_of
from fluxlock.config import Scenario, load_motor
from tests.commission.averaged_bench import AveragedBench, Machine, converse

Invoke = Callable[..., tuple[int, str, str]]
PLANT, INVERTER = str(ROOT / "motors" / "motor-1.toml"), str(ROOT / "inverters" / "bench-25v.toml")


@pytest.fixture
def invoke(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Invoke:
    """Call main() with arguments; returns exit code, stdout, stderr."""

    def call(*arguments: str) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["fluxlock", "identify", *arguments])
        monkeypatch.setenv("COLUMNS", "120")
        with pytest.raises(SystemExit) as caught:
            cli.main()
        out, err = capsys.readouterr()
        return int(caught.value.code or 0), out, err

    return call


def averaged(bench: Scenario, folder: Path, seed: int, progress: Callable[[ProgressInfo], None]) -> Measured:
    """Stands in for the simulated chip."""
    talk, _ = known_of(bench)
    progress(ProgressInfo(0.1, 0.5, 0.0, 1e6, "run"))
    lab = AveragedBench(talk.scales, Machine(), seed=seed)
    return Measured(converse(lab, talk.conversation()), lab.time_s, 1.0)


def test_files_and_tables(invoke: Invoke, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Motor file and figure are written, the table has the plant's values and the errors, `--json` the same.

    Verifies: IDENT-06
    """
    monkeypatch.setattr(command, "measure", averaged)
    path = tmp_path / "found.toml"
    code, out, err = invoke("--plant", PLANT, "--inverter", INVERTER, "--out", str(path))
    assert code == 0, err
    assert out.startswith("ok: off the plant: R winding + switch, mean ")
    assert "R winding + switch, mean" in out and "current, 800 Hz: k_p d" in out and "found.png" in out
    assert load_motor(path).psi_vs[0] == pytest.approx(1e-3, rel=0.03)
    assert (tmp_path / "found.png").stat().st_size > 10_000
    code, out, err = invoke("--plant", PLANT, "--inverter", INVERTER, "--out", str(path), "--json", "--seed", "3")
    assert code == 0, err
    document = json.loads(out)
    assert document["seed"] == 3 and abs(document["error_percent"]["flux"]) < 3.0
    assert document["gains"]["speed, 20 Hz: k_p"]["value"] > 0.0 and document["verdict"]["passed"]


def test_wrong_measurement_fails(invoke: Invoke, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A machine that is not the one on the bench: exit code 1 and a line with both values, also with `--json`.

    Verifies: FRONT-35
    """

    def other(bench: Scenario, folder: Path, seed: int, progress: Callable[[ProgressInfo], None]) -> Measured:
        found = averaged(bench, folder, seed, progress)
        return replace(found, values={**found.values, "psi_vs": 1.1 * found.values["psi_vs"]})

    monkeypatch.setattr(command, "measure", other)
    path = str(tmp_path / "found.toml")
    for arguments in ((), ("--json",)):
        code, _, err = invoke("--plant", PLANT, "--inverter", INVERTER, "--out", path, *arguments)
        assert code == 1
        (line,) = (text for text in err.splitlines() if text.startswith("failed: "))
        wanted = r"failed: flux is 1\.\d+ mV s, the plant has 1 \(\+\d+\.\d %, permitted 3 %\)"
        assert re.fullmatch(wanted, line), line


def test_bad_input_is_refused(invoke: Invoke, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A line for what cannot be: file names, files; a machine that cannot be measured is a failure, not bad input.

    Verifies: IDENT-08
    """
    for arguments, text in (
        (("--plant", PLANT, "--inverter", INVERTER, "--out", str(tmp_path / "a.txt")), "ends in .toml"),
        (("--plant", PLANT, "--inverter", INVERTER, "--out", PLANT), "is one of the files that are read"),
        (("--plant", PLANT, "--inverter", PLANT), "is a motor file, not an inverter file"),
        (("--plant", PLANT + "x", "--inverter", INVERTER), "file not found"),
        (("--plant", PLANT, "--inverter", INVERTER, "--seed", "-1"), "must be a whole number"),
    ):
        code, _, err = invoke(*arguments)
        assert code == 2 and text in err, err
        assert "Traceback" not in err

    def refuse(*_: object) -> Measured:
        raise MeasurementError("the rotor does not come to rest")

    monkeypatch.setattr(command, "measure", refuse)
    out = tmp_path / "found.toml"
    code, _, err = invoke("--plant", PLANT, "--inverter", INVERTER, "--out", str(out))
    assert code == 1 and "failed: identify: the rotor does not come to rest" in err
    assert not out.exists()


def test_regulator_on_the_core_is_refused(invoke: Invoke, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The program on the chip answers no regulator step: file, key and remedy in a line, and nothing is written.

    Verifies: IDENT-09
    """
    scenario = tmp_path / "bench.toml"
    text = bench_module.SCENARIO.read_text(encoding="utf-8").replace('"../../', f'"{ROOT}/')
    scenario.write_text(text.replace("delay = 1.0\n", 'delay = 1.0\ncurrent_regulator = "c"\n'), encoding="utf-8")
    monkeypatch.setattr(bench_module, "SCENARIO", scenario)
    monkeypatch.setattr(command, "measure", averaged)
    out = tmp_path / "found.toml"
    code, _, err = invoke("--plant", PLANT, "--inverter", INVERTER, "--out", str(out))
    assert code == 2, err
    assert f'{scenario}: drive.vector.current_regulator: "c"' in err and 'set it to "rtl"' in err, err
    assert "Traceback" not in err
    assert sorted(tmp_path.iterdir()) == [scenario]
