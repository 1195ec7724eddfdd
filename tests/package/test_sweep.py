# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Sweeps: ranges, grids, results kept by content."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure
from typer.testing import CliRunner

import fluxlock
from fluxlock import sweep_cli, sweeps
from fluxlock.base.paths import ROOT
from fluxlock.cli import app
from fluxlock.sweeps import Axis, Grid
from fluxlock.theory.six_step import plots
from fluxverify import sweep_bench

OWN = ROOT / "scenarios" / "own-spindle.toml"
SHORT = {"duration_s": 0.02, "window": [], "expect": [], "event": []}
GRID = {"motor.resistance_ohm": [0.14, 0.15], "drive.commutation": ["RSC", "CSC"]}


def short() -> fluxlock.Scenario:
    return fluxlock.scenario_of(OWN, SHORT)


@pytest.mark.parametrize(
    ("text", "values", "factors"),
    [
        ("motor.resistance_ohm=0.1:0.3:3", (0.1, 0.2, 0.3), False),
        ("motor.resistance_ohm=0.8x:1.2x:3", (0.8, 1.0, 1.2), True),
        ("seed=1:5:3", (1, 3, 5), False),
        ("drive.commutation=RSC,NSC,CSC", ("RSC", "NSC", "CSC"), False),
        ("drive.carrier_hz=20_000, 40_000", (20_000, 40_000), False),
        ("motor.resistance_ohm=[0.1, 0.1, 0.2],0.1", ([0.1, 0.1, 0.2], 0.1), False),
        ("drive.zcd.linearity=true,false", (True, False), False),
    ],
)
def test_ranges(text: str, values: tuple[Any, ...], factors: bool) -> None:
    """Ranges, factors and lists.

    Verifies: PACKAGE-8
    """
    axis = Axis.parse(text)
    assert axis.values == pytest.approx(values) if isinstance(values[0], float) else axis.values == values
    assert axis.factors == factors


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("motor.resistance_ohm", "must have the form"),
        ("motor.resistance_ohm=0.1:0.3", "no range of numbers LOW:HIGH:COUNT"),
        ("=1:2:3", "must have the form"),
        ("motor.resistance_ohm=", "must have the form"),
        ("motor.resistance_ohm=a:2:3", "no range of numbers"),
        ("motor.resistance_ohm=1:2:0", "count from 1"),
        ("motor.resistance_ohm=1:inf:3", "finite ends"),
        ("motor.resistance_ohm=0.8x:1.2:3", "both ends are factors"),
        ("drive.commutation=RSC,,CSC", "empty value"),
        ("drive.commutation=0.8x:1.2x:3", "no number in the file"),
        ("motor.no_such=0.8x:1.2x:3", "no number in the file"),
    ],
)
def test_bad_ranges(text: str, message: str) -> None:
    """What is no range is refused by key.

    Verifies: PACKAGE-8
    """
    with pytest.raises(fluxlock.ConfigError, match=message):
        Grid.of(short(), [Axis.parse(text)])


def test_grid() -> None:
    """The last key changes fastest; a point that the checks refuse has its reason, the others run.

    Verifies: PACKAGE-8
    """
    grid = Grid.of(short(), [Axis("motor.resistance_ohm", (0.14, -1.0)), Axis("drive.commutation", ("RSC", "CSC"))])
    assert [dict(point.keys) for point in grid.points] == [
        {"motor.resistance_ohm": 0.14, "drive.commutation": "RSC"},
        {"motor.resistance_ohm": 0.14, "drive.commutation": "CSC"},
    ]
    assert [row["point"] for row in grid.refused] == [2, 3] and all(
        "out of range" in row["reason"] for row in grid.refused
    )
    with pytest.raises(fluxlock.ConfigError, match=r"out of range(.|\n)*unknown key"):
        Grid.of(short(), [Axis("motor.resistance_ohm", (-1.0,)), Axis("motor.no_such", (1, 2))])
    with pytest.raises(fluxlock.ConfigError, match="is there twice"):
        Grid.of(short(), [Axis("seed", (1,)), Axis("seed", (2,))])
    with pytest.raises(fluxlock.ConfigError, match="is there twice"):
        Grid.of(short(), [Axis("motor__resistance_ohm", (1,)), Axis("motor.resistance_ohm", (2,))])
    (scaled,) = Grid.of(short(), [Axis("motor__resistance_ohm", (0.5,), factors=True)]).axes
    assert scaled == Axis("motor.resistance_ohm", (0.075,))
    with pytest.raises(fluxlock.ConfigError, match=r"motor\.resistance_ohm: has no value(.|\n)*seed: has no value"):
        fluxlock.sweep(short(), {"motor.resistance_ohm": [], "drive.commutation": ["RSC"], "seed": []})
    with pytest.raises(fluxlock.ConfigError, match="no key to change"):
        Grid.of(short(), [])
    with pytest.raises(fluxlock.ConfigError, match="permitted 1 to"):
        Grid.of(short(), [Axis("seed", tuple(range(1000))), Axis("motor.resistance_ohm", tuple(range(1, 1000)))])


@pytest.mark.parametrize(
    ("stated", "values"),
    [
        ("0.1:0.3:3", (0.1, 0.2, 0.3)),
        (np.linspace(0.1, 0.3, 3), (0.1, 0.2, 0.3)),
        ([np.float32(0.5), Path("a/b.toml")], (0.5, "a/b.toml")),
        (range(1, 3), (1, 2)),
    ],
)
def test_axes_from_code(stated: Any, values: tuple[Any, ...]) -> None:
    """Values of NumPy, paths, and a range in words.

    Verifies: PACKAGE-8
    """
    (axis,) = sweeps.axes_of({"motor.resistance_ohm": stated})
    assert axis.key == "motor.resistance_ohm"
    assert axis.values == values if isinstance(values[-1], str) else axis.values == pytest.approx(values)
    assert all(type(value) in (int, float, str) for value in axis.values)
    assert sweeps.axes_of([Axis("seed", (np.int64(1),))])[0].values == (1,)


@pytest.mark.parametrize(
    ("axes", "options", "message"),
    [
        (None, {}, "^must be a dict, key: values, not None$"),
        (5, {}, "^must be a dict, key: values, not 5$"),
        ({"seed": 5}, {}, r"^seed: must be a list of values, not 5$"),
        ({"motor": fluxlock.load_motor(ROOT / "motors" / "spindle-2pp.toml")}, {}, "^motor: must be a list of values"),
        (["seed=1:2:2"], {}, r"^must be a dict, key: values, not \['seed=1:2:2'\]$"),
        ({}, {}, "^no key to change"),
        ({"motor.resistence_ohm": [0.1]}, {}, '^motor.resistence_ohm: unknown key, did you mean "resistance_ohm"'),
        ({"seed": [1]}, {"jobs": 0}, "^jobs: must be a whole number from 1, not 0$"),
        ({"seed": [1]}, {"seed": -1}, "^seed: must be a whole number from 0 to 2147483647, not -1$"),
        ({"seed": [1]}, {"folder": OWN}, "^folder: .*points: cannot be written: "),
        ({"seed": [1]}, {"scheduler": 8786}, "^--scheduler: 8786: no scheduler answers there"),
    ],
)
def test_bad_arguments(axes: Any, options: dict[str, Any], message: str) -> None:
    """What is no grid, no number of jobs, no seed, no folder and no address is refused by name, before anything runs.

    Verifies: PACKAGE-8, PACKAGE-9
    """
    with pytest.raises(fluxlock.ConfigError, match=message):
        fluxlock.sweep(short(), axes, twin=True, **options)


def test_alignment_on_the_twin() -> None:
    """The twin, which has no carrier, does not tell RSC from NSC, as the page says; CSC is another drive.

    Verifies: PACKAGE-8
    """
    keys = {**SHORT, "duration_s": 0.1, "window": [{"name": "end", "from_s": 0.09, "to_s": 0.1}]}
    keys |= {"initial.speed_rpm": 14_000.0, "event": [{"at_s": 0.004, "speed_rpm": 15_000.0}]}
    keys["event"] += [{"at_s": 0.005, "command": "start"}]
    made = fluxlock.sweep(fluxlock.scenario_of(OWN, keys), {"drive.commutation": "RSC,NSC,CSC"}, twin=True)
    rsc, nsc, csc = ({key: row[key] for key in row if key.startswith("end.")} for row in made.rows)
    assert rsc == nsc != csc and len(rsc) > 3


def test_machine_that_cannot_run() -> None:
    """A machine that the twin is not, inside a grid: its row says why, in words of its key, and the others run.

    Verifies: PACKAGE-8
    """
    files = [f"motors/{name}.toml" for name in ("spindle-2pp", "five-phase-yu")]
    motors = [fluxlock.load_motor(file) for file in files]
    for given, names in ((motors, [motor.name for motor in motors]), (",".join(files), files)):
        made = fluxlock.sweep(short(), {"motor": given}, twin=True)
        assert [row["status"] for row in made.rows] == ["right", "refused"]
        assert "phases" in made.rows[1]["reason"]
        assert [row["motor"] for row in made.rows] == names


def test_file_that_is_not_there(tmp_path: Path) -> None:
    """The file of a motor or an inverter that does not exist is a typo: it ends the sweep before the first run.

    Verifies: PACKAGE-8
    """
    own = "motors/spindle-2pp.toml"
    lost = (
        r"^motor: file not found \(motors/spindle-2p\.toml\), did you mean \"spindle-2pp\.toml\"\?\ninverter: file not"
    )
    axes = {"motor": [own, "motors/spindle-2p.toml"], "inverter": ["inverters/nope.toml"]}
    with pytest.raises(fluxlock.ConfigError, match=lost):
        fluxlock.sweep(short(), axes, twin=True, folder=tmp_path)
    arguments = ["sweep", str(OWN), "--twin", "--out", str(tmp_path), "--set", f"motor={own},motors/nope.toml"]
    with pytest.raises(fluxlock.ConfigError, match=r"motor: file not found \(motors/nope\.toml\)"):
        CliRunner().invoke(app, arguments, catch_exceptions=False)
    assert not list(tmp_path.rglob("*.json"))


def test_each_reason() -> None:
    """The verdict has each reason of a refusal with the first of its points; other numbers are no other reason.

    Verifies: PACKAGE-8
    """
    axis = Axis("motor", ("a", "b", "c", "d"))
    reasons = ["R -1 is out of range", "R -2e-3 is out of range", "five phases", ""]
    rows = [
        {"point": k, "motor": name, "status": "refused" if reason else "right", "reason": reason}
        for k, (name, reason) in enumerate(zip(axis.values, reasons, strict=True))
    ]
    assert sweep_cli.verdict(sweeps.Sweep((axis,), rows)).lines == [
        "1 of 1 points right",
        "refused (2), first at motor a: R -1 is out of range",
        "refused (1), first at motor c: five phases",
    ]


def test_progress(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Progress counts points that ran, were refused or were there; a sweep is shown by its counts.

    Verifies: PACKAGE-8
    """
    grid = {"motor.resistance_ohm": [0.14, -1.0]}
    made = fluxlock.sweep(short(), grid, twin=True, folder=tmp_path, progress=True)
    assert [line.split()[:2] for line in capsys.readouterr().err.splitlines()] == [["points", "1/2"], ["points", "2/2"]]
    assert repr(made) == "<Sweep of motor.resistance_ohm: 1 right, 1 refused>"
    fluxlock.sweep(short(), grid, twin=True, folder=tmp_path)
    assert capsys.readouterr().err == ""


def test_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Results are kept by content: an equal sweep runs nothing, another seed or value does.

    Verifies: PACKAGE-8
    """
    ran: list[int] = []

    def one_by_one(work: Any, items: Any, jobs: int, done: Any) -> None:
        for point in items:
            ran.append(point.index)
            done(point, work(point))

    monkeypatch.setattr(sweeps, "side_by_side", one_by_one)
    first = fluxlock.sweep(short(), GRID, twin=True, folder=tmp_path)
    assert ran == [0, 1, 2, 3] and first.passed
    assert fluxlock.sweep(short(), GRID, twin=True, folder=tmp_path).rows == first.rows and len(ran) == 4
    again = fluxlock.sweep(short(), {**GRID, "motor.resistance_ohm": [0.15, 0.16]}, twin=True, folder=tmp_path)
    assert ran[4:] == [2, 3] and again.rows[0] == first.rows[2] | {"point": 0}
    fluxlock.sweep(short(), {"drive.commutation": ["RSC"]}, twin=True, folder=tmp_path, seed=2)
    assert ran[6:] == [0]


def test_other_keys_in_one_folder(tmp_path: Path) -> None:
    """A result that a sweep of other keys has left has the columns of the sweep that reads it, also if it failed.

    Verifies: PACKAGE-8
    """
    keys = {**SHORT, "window": [{"name": "end", "from_s": 0.01, "to_s": 0.02}]}
    keys["expect"] = [{"window": "end", "metric": "speed_rpm.mean", "min": 1e6}]
    failing = fluxlock.scenario_of(OWN, keys)
    axes = {"drive.commutation": ["RSC", "CSC"]}
    first = fluxlock.sweep(failing, {"seed": [1], **axes}, twin=True, folder=tmp_path)
    stored = {path: path.stat().st_mtime_ns for path in (tmp_path / "points").iterdir()}
    other = fluxlock.sweep(failing, {"drive.commutation": ["CSC", "RSC"]}, twin=True, folder=tmp_path)
    assert stored == {path: path.stat().st_mtime_ns for path in (tmp_path / "points").iterdir()} and len(stored) == 2
    assert [row["status"] for row in other.rows] == ["failed", "failed"]
    for row, before in zip(other.rows, first.rows[::-1], strict=True):
        found = {key: value for key, value in before.items() if key not in ("seed", "point")}
        assert {key: value for key, value in row.items() if key != "point"} == found
    assert [row["drive.commutation"] for row in other.rows] == ["CSC", "RSC"]
    assert "first at drive.commutation CSC" in sweep_cli.verdict(other).lines[1]
    alone = fluxlock.sweep(failing, {"seed": [1]}, twin=True, folder=tmp_path)
    assert list(alone.rows[0])[:2] == ["point", "seed"] and "first at seed 1" in sweep_cli.verdict(alone).lines[1]


def test_other_packages(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A result of other packages, NumPy's for instance, is none of these.

    Verifies: PACKAGE-8
    """
    for version in ("1", "2"):
        monkeypatch.setattr(sweeps, "versions", lambda version=version: {"numpy": version})
        for _ in range(2):
            fluxlock.sweep(short(), {"seed": [1]}, twin=True, folder=tmp_path)
        assert len(list((tmp_path / "points").iterdir())) == int(version)


def test_command(tmp_path: Path) -> None:
    """Table, picture and a verdict in words; a refused point is named and the others run.

    Verifies: PACKAGE-8
    """
    arguments = [
        "sweep",
        str(OWN),
        "--twin",
        "--jobs",
        "1",
        "--out",
        str(tmp_path),
        "--set",
        "motor.resistance_ohm=0.15,-1",
    ]
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == 0, done.output
    assert (
        done.stdout.startswith("ok: 1 of 1 points right")
        and "refused (1), first at motor.resistance_ohm -1" in done.stdout
    )
    table = pd.read_parquet(tmp_path / "sweep.parquet")
    assert list(table["status"]) == ["right", "refused"] and table["steady.speed_rpm.mean"][0] == pytest.approx(
        15_000, rel=0.005
    )
    assert (tmp_path / "overview.png").stat().st_size > 10_000
    (tmp_path / "sweep.parquet").unlink()
    with pytest.raises(
        fluxlock.ConfigError, match=r"steady\.nope: no such column; there are: .*steady\.speed_rpm\.mean"
    ):
        CliRunner().invoke(app, [*arguments, "--metric", "steady.nope"], catch_exceptions=False)
    assert len(pd.read_parquet(tmp_path / "sweep.parquet")) == 2


@pytest.mark.parametrize("failed", [False, True])
def test_picture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, failed: bool) -> None:
    """The picture says of what it is; it explains crosses where it has some.

    Verifies: PACKAGE-8
    """
    drawn: list[Figure] = []
    monkeypatch.setattr(plots, "save", lambda figure, path: drawn.append(figure))
    name = "end.speed_rpm.mean"
    rows = [{"point": 0, "seed": 1, "status": "right", "reason": "", name: 1.0}]
    rows += [{"point": 1, "seed": 2, "status": "failed" if failed else "right", "reason": "", name: 2.0}]
    made = sweeps.Sweep((Axis("seed", (1, 2)),), rows)
    sweep_cli.draw(made, made.to_dataframe(), [name], tmp_path / "overview.png", "spindle, twin")
    assert drawn[0].get_suptitle() == "spindle, twin"
    assert drawn[0].axes[-1].get_xlabel() == "seed" + ("; crosses: the run failed its verdict" if failed else "")


@pytest.mark.parametrize(
    ("axes", "options", "title"),
    [
        (("motor.resistance_ohm",), (True, None), "own-spindle, twin, seed 1"),
        (("motor.resistance_ohm", "seed"), (False, None), "own-spindle, chip"),
        (("seed",), (True, 7), "own-spindle, twin, seed 7"),
    ],
)
def test_title(axes: tuple[str, ...], options: tuple[bool, int | None], title: str) -> None:
    """Scenario, twin or chip, and the seed unless it is a key of the grid.

    Verifies: PACKAGE-8
    """
    assert sweep_cli.title_of(short(), sweeps.Sweep(tuple(Axis(key, ()) for key in axes), []), *options) == title


def test_bench(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """The measurement of memory, time and overhead runs: a line for the pairs, one for each stretch of runs.

    Verifies: PACKAGE-8
    """
    monkeypatch.setattr(sweep_bench, "POINT", SHORT)
    monkeypatch.setattr(sweep_bench, "EVERY", 2)
    monkeypatch.setattr(sys, "argv", ["sweep_bench", "--runs", "4", "--pairs", "2"])
    assert sweep_bench.main() == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("overhead of a point: median ") and lines[0].endswith("% of 2 pairs")
    assert [line.split(":")[0] for line in lines[1:]] == ["2 runs", "4 runs"] and "ms per run" in lines[2]
