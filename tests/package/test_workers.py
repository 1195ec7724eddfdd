# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Runs on workers: those of Dask and of the pool, strange ones and lost ones."""

from __future__ import annotations

import os
import pickle
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import distributed
import pytest
import typer
from typer.testing import CliRunner

import fluxlock
from fluxlock import sweeps, workers
from fluxlock.base.paths import BUILD, ROOT
from fluxlock.cli import app
from fluxlock.command_line import run_command_line
from fluxlock.config import Problem
from fluxlock.population import run as population
from fluxlock.sweeps import Axis, Grid
from fluxverify.campaign import fuzz
from fluxverify.cli import app as verify
from fluxverify.figures import command as figures
from fluxverify.mutation import run as mutation
from fluxverify.mutation.netlist import make_netlist
from fluxverify.regression import run as regression
from tests.mutation.test_mutation import SMALL
from tests.package.dask_workers import BEGIN_S, dask_workers

OWN = ROOT / "scenarios" / "own-spindle.toml"
SHORT = {"duration_s": 0.02, "window": [], "expect": [], "event": []}
PACKAGES = ("fluxlock", "numpy", "numba", "ziglang")
GRID = {"motor.resistance_ohm": [0.14, 0.15], "drive.commutation": ["RSC", "CSC"]}


def short() -> fluxlock.Scenario:
    return fluxlock.scenario_of(OWN, SHORT)


def test_another_version(monkeypatch: pytest.MonkeyPatch) -> None:
    """A worker whose sources differ is refused by name.

    Verifies: PACKAGE-9
    """
    grid = Grid.of(short(), [Axis("drive.commutation", ("RSC",))])
    with pytest.raises(sweeps.OtherVersion, match="another version of Fluxlock"):
        sweeps.run_point(1, True, "0123456789abcdef", None, grid.points[0])

    def on_another(work: Any, items: Any, jobs: int, done: Any) -> None:
        sweeps.run_point(1, True, "0123456789abcdef", None, items[0])

    monkeypatch.setattr(sweeps, "side_by_side", on_another)
    with pytest.raises(fluxlock.ConfigError, match=r"^--scheduler: tcp://there:8786: a worker has another version"):
        grid.run(twin=True, scheduler="tcp://there:8786")
    with pytest.raises(fluxlock.ConfigError, match=r"^--jobs: 2: a worker has another version"):
        grid.run(twin=True, jobs=2)

    def loses(work: Any, items: Any, jobs: int, done: Any) -> None:
        raise workers.WorkerLost(workers.LOST)

    monkeypatch.setattr(sweeps, "side_by_side", loses)
    with pytest.raises(fluxlock.ConfigError, match=r"^--jobs: 2: a worker process ended"):
        grid.run(twin=True, jobs=2)


def test_no_scheduler(monkeypatch: pytest.MonkeyPatch) -> None:
    """No scheduler at the address: one line that says how to start one.

    Verifies: PACKAGE-9
    """
    monkeypatch.setattr(workers, "ANSWER_S", 0.5)
    with pytest.raises(fluxlock.ConfigError, match="start one with `dask scheduler`"):
        fluxlock.sweep(short(), GRID, twin=True, scheduler="tcp://127.0.0.1:9")
    with pytest.raises(fluxlock.ConfigError, match="no scheduler answers"):
        fluxlock.sweep(short(), GRID, twin=True, scheduler="nonsense://x")
    for cluster, text in (
        ({"asynchronous": True}, "an asynchronous cluster cannot answer while this call waits"),
        (
            {"security": distributed.Security(require_encryption=True)},
            "no scheduler answers there .*encryption required",
        ),
    ):
        with pytest.raises(fluxlock.ConfigError, match=rf"^--scheduler: tcp://127.0.0.1:9: {text}"):
            at = SimpleNamespace(scheduler_address="tcp://127.0.0.1:9", **cluster)
            fluxlock.sweep(short(), GRID, twin=True, scheduler=at)


def refuses_strangers(address: str) -> None:
    """A worker with other sources, other packages or without the folder is refused by name; else the items run."""
    found: dict[str, int] = {}
    with workers.on_scheduler(SimpleNamespace(scheduler_address=address)):  # a cluster of Dask
        workers.side_by_side(len, ["a", "bc"], 1, found.__setitem__, shares_build=True)
    assert found == {"a": 1, "bc": 2}
    for name, value, text in (
        ("BUILD", Path(tempfile.gettempdir()), "a worker does not have the folder .*share the checkout"),
        ("sources", lambda package: "0123456789abcdef", "a worker has another version"),
        (
            "versions",
            lambda: {"Python": "3.9", **dict.fromkeys(PACKAGES, "0.1"), "none": "7"},
            r"a worker has Python 3\.\d+ in place of 3\.9, "
            + ", ".join(rf"{name} \d[\w.]* in place of 0\.1" for name in PACKAGES)
            + ", none missing in place of 7: results might differ",
        ),
    ):
        with pytest.MonkeyPatch.context() as patch, workers.on_scheduler(address):
            patch.setattr(workers, name, value)
            with pytest.raises(workers.OtherVersion, match=text):
                workers.side_by_side(len, ["a"], 1, found.__setitem__, shares_build=True)


@pytest.mark.parametrize(
    ("command", "text"),
    [
        (["regression", "--list"], "--list runs nothing"),
        (["regression", "--accept", "x", "--why", "y"], "--accept runs nothing"),
        (["campaign", "--show"], "--show runs nothing"),
        (["figures", "six-step", "--list"], "--list runs nothing"),
    ],
)
def test_no_runs(command: list[str], text: str) -> None:
    """A scheduler beside an option that runs nothing is refused by name.

    Verifies: PACKAGE-9
    """
    with pytest.raises(fluxlock.ConfigError, match=rf"^--scheduler: tcp://x:1: {text}"):
        CliRunner().invoke(verify, [*command, "--scheduler", "tcp://x:1"], catch_exceptions=False)


@pytest.mark.parametrize("command", ["regression", "campaign", "fuzz", "figures", "mutate"])
def test_option_of_the_long_runs(command: str) -> None:
    """Each command of long runs takes a scheduler.

    Verifies: PACKAGE-9
    """
    assert "--scheduler" in CliRunner().invoke(verify, [command, "--help"]).output


def test_population_without_a_scheduler(monkeypatch: pytest.MonkeyPatch) -> None:
    """The population asks the scheduler too.

    Verifies: PACKAGE-9
    """
    monkeypatch.setattr(workers, "ANSWER_S", 0.5)
    words = ["population", "run", "--method", "vector", "--lives", "1", "--scheduler", "tcp://127.0.0.1:9"]
    with pytest.raises(fluxlock.ConfigError, match="no scheduler answers"):
        CliRunner().invoke(app, words, catch_exceptions=False)


# A worker that keeps its lives in a folder of its own: none is there before.
LIVING = """
import fluxlock.population.run as run, pathlib
assert "copy" in run.__file__
run.FOLDER = pathlib.Path("there").absolute()
from distributed.cli.dask_worker import main
main()
"""


def test_population_on_workers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two workers in a copy of the checkout at another place give the rows of this process, bit for bit.

    Verifies: PACKAGE-9
    """
    for name in ("sim", "rtl", "sw", "motors", "inverters", "scenarios"):
        shutil.copytree(ROOT / name, tmp_path / "copy" / name)
    environment = {**os.environ, "PYTHONPATH": str(tmp_path / "copy" / "sim")}
    monkeypatch.setattr(population, "FOLDER", tmp_path / "here")
    indices, rows = range(3), []
    with dask_workers(tmp_path, 0, environment) as dask:
        for _ in range(2):
            dask.begin_worker(["-c", LIVING])
        for scheduler in (None, dask.address()):
            with workers.on_scheduler(scheduler):
                rows.append(population.run_lives("six-step", 1, indices, 1, lambda: None))
    here, there = ([{k: v for k, v in row.items() if k != "cpu_s"} for row in found] for found in rows)
    assert here == there and [row["index"] for row in here] == list(indices)
    names = [{path.name for path in (tmp_path / folder).rglob("*.json")} for folder in ("here", "there")]
    assert names[0] == names[1] and len(names[0]) > 0


@pytest.fixture
def bare_path(tmp_path: Path) -> str:
    """PATH of a machine without compiler and make."""
    folder = tmp_path / "bin"
    folder.mkdir()
    for name in ("sh", "uname", "getconf", "tr", "wc", "dirname", "perl"):
        (folder / name).symlink_to(shutil.which(name) or name)
    return str(folder)


LACKS = "this machine lacks:\n  make: install make .*\n  g\\+\\+: install g\\+\\+ "


def test_machine_without_tools(bare_path: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The chip asks for the compiler, from Python by ConfigError, and no point is kept as refused; the twin does not.

    Verifies: PACKAGE-5, PACKAGE-8
    """
    monkeypatch.setenv("PATH", bare_path)
    monkeypatch.delenv("CXX", raising=False)
    with pytest.raises(fluxlock.ConfigError, match=f"^{LACKS}"):
        fluxlock.simulate(short())
    with pytest.raises(fluxlock.ConfigError, match=f"^{LACKS}"):
        fluxlock.sweep(short(), GRID, folder=tmp_path, jobs=2)
    assert not list((tmp_path / "points").iterdir())
    arguments = ["sweep", str(OWN), "--out", str(tmp_path), "--jobs", "1", "--set", "motor.resistance_ohm=0.15"]
    with pytest.raises(fluxlock.ConfigError, match=f"^{LACKS}"):
        CliRunner().invoke(app, arguments, catch_exceptions=False)
    assert CliRunner().invoke(app, [*arguments, "--twin"], catch_exceptions=False).exit_code == 0


def test_worker_without_tools(bare_path: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A worker without a compiler is named with what it lacks, and lives on; it runs twins.

    Verifies: PACKAGE-5, PACKAGE-9
    """
    monkeypatch.setattr(workers, "DESERTED_S", 1)
    environment = {name: value for name, value in os.environ.items() if name != "CXX"} | {"PATH": bare_path}
    with dask_workers(tmp_path, 1, environment) as dask:
        named = rf"^--scheduler: {dask.address()}: tcp://\S+: {LACKS}"
        with pytest.raises(fluxlock.ConfigError, match=named):
            fluxlock.sweep(short(), {"seed": [1]}, scheduler=dask.address())
        assert fluxlock.sweep(short(), {"seed": [1]}, twin=True, scheduler=dask.address()).passed


def test_error_from_another_process() -> None:
    """Problems and text of a ConfigError stay what they are on their way from a worker.

    Verifies: PACKAGE-9
    """
    error = fluxlock.ConfigError([Problem("a", "b", "c"), Problem("", "", "d")])
    again = pickle.loads(pickle.dumps(error))
    assert (again.problems, str(again)) == (error.problems, "a: b: c\nd")


def of_regression(folder: Path) -> object:
    """Rows of a case that runs the firmware's functions on the host."""
    names = ["vector/observer-delay/host"]
    return regression.run_cases(names, quick=True, jobs=2)["rows"]


def of_figures(folder: Path) -> object:
    """A figure without a run of the chip, and its picture."""
    drawn = figures.draw_all(figures.select("six-step", ["5.10"]), "six-step", folder, True, 1, 2)
    return drawn, [(path.name, path.read_bytes()) for path in sorted(folder.iterdir())]


def of_fuzz(folder: Path) -> object:
    """Two copies of a chip that writes to registers at random."""
    return fuzz.fuzz("six-step", 1, 2, 1e-3, 2)


def of_mutation(folder: Path) -> object:
    """Which test kills each mutant of a small block, under a name that no other test measures."""
    source = BUILD / "mutate" / "fl_shared.sv"  # in the checkout, as every source
    source.parent.mkdir(exist_ok=True)
    source.write_text(Path(SMALL.sources[0]).read_text(encoding="utf-8").replace("fl_small", "fl_shared"))
    block = replace(SMALL, name="fl_shared", sources=(str(source),))
    netlist = make_netlist(block, 8, 1)
    (mutation.folder(block) / mutation.OUTCOMES).unlink(missing_ok=True)  # of the other place
    found = mutation.run_mutants(block, netlist, [m.number for m in netlist.mutants], 1, 2, lambda _: None)
    return sorted((number, outcome["killed_by"]) for number, outcome in found.items())


@pytest.mark.parametrize("run", [of_regression, of_figures, of_fuzz, of_mutation])
def test_long_runs_on_workers(run: Callable[[Path], object], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Regression, figures, fuzz and mutation give the same on workers as in the pool, bit for bit.

    Verifies: PACKAGE-9
    """
    for module in (regression, figures):
        monkeypatch.setattr(module, "prepare_runs", lambda quick: None)  # their part has no chip
    found = []
    with dask_workers(tmp_path, 1) as dask:
        for place, scheduler in (("pool", None), ("workers", dask.address())):
            (tmp_path / place).mkdir()
            with workers.on_scheduler(scheduler):
                found.append(run(tmp_path / place))
    assert found[0] and found[0] == found[1] and "failure" not in str(found[0]).replace("'failure': ''", "")


# A worker in an environment that has Dask, but not this package.
BARE = "import sys; sys.modules['fluxlock'] = None; from distributed.cli.dask_worker import main; main()"


def test_strange_and_lost_workers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Strangers among the workers are refused by name; when all have gone the items end by name.

    Verifies: PACKAGE-9
    """
    with dask_workers(tmp_path, 1) as dask:
        address = dask.address()
        refuses_strangers(address)
        dask.workers[0].kill()
        monkeypatch.setattr(workers, "DESERTED_S", 1)
        with workers.on_scheduler(address), pytest.raises(fluxlock.ConfigError, match="has had no worker for 1 s"):
            workers.side_by_side(len, ["a"], 1, lambda *_: None)
        dask.begin_worker(["-c", BARE])
        with distributed.Client(address) as client:
            client.wait_for_workers(1, BEGIN_S)
        stranger = r"^tcp://\S+: a worker has no Fluxlock"
        with workers.on_scheduler(address), pytest.raises(workers.OtherVersion, match=stranger):
            workers.side_by_side(len, ["a"], 1, lambda *_: None)


def test_command_that_loses_a_worker(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """A command whose process ended says so in one line.

    Verifies: PACKAGE-9
    """
    planted = typer.Typer()

    @planted.command()
    def lose() -> None:
        raise workers.WorkerLost(workers.LOST)

    monkeypatch.setattr(sys, "argv", ["fluxlock"])
    with pytest.raises(SystemExit) as caught:
        run_command_line(planted, "fluxlock")
    assert caught.value.code == 2
    assert capsys.readouterr().err == f"error: {workers.LOST}\n"


def test_script_without_guard(tmp_path: Path) -> None:
    """A script that asks for processes at its top level is told what to change.

    Verifies: PACKAGE-9
    """
    script = tmp_path / "script.py"
    script.write_text("from fluxlock.workers import side_by_side\nside_by_side(len, ['a', 'b'], 2, print)\n")
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, check=False)
    assert done.returncode == 1 and "WorkerLost" in done.stderr and "__main__" in done.stderr.splitlines()[-1]
