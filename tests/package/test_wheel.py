# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The wheel without a checkout: unpacked into a folder of its own, run from an empty folder with an empty home."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from fluxlock.base.paths import BUILD, ROOT
from fluxlock.workers import sources
from tests.package.dask_workers import dask_workers

# A sweep of 24 points that prints its rows; the process that the second argument names is killed half-way.
SWEEP = """
import json, os, signal, sys
import fluxlock

KEYS = {
    "duration_s": 0.03,
    "initial.speed_rpm": 14_000.0,
    "event": [{"at_s": 0.004, "speed_rpm": 15_000.0}, {"at_s": 0.005, "command": "start"}],
    "window": [{"name": "held", "from_s": 0.02, "to_s": 0.03}],
    "expect": [],
}


def main(scheduler: str = "", victim: str = "") -> None:
    ended = []

    def done(row):
        ended.append(row)
        if victim and len(ended) == 12:
            os.kill(int(victim), signal.SIGKILL)

    scenario = fluxlock.scenario_of("scenarios/own-spindle.toml", KEYS)
    grid = {"motor.resistance_ohm": "0.8x:1.2x:4", "drive.commutation": ["RSC", "CSC"], "seed": range(1, 4)}
    made = fluxlock.sweep(scenario, grid, twin=True, jobs=2, scheduler=scheduler or None, done=done)
    print(json.dumps(made.rows))


if __name__ == "__main__":
    main(*sys.argv[1:])
"""


class Installed:
    """The package as pip lays it out; its dependencies are those of this environment."""

    def __init__(self, base: Path) -> None:
        command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(base)]
        subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
        (wheel,) = base.glob("fluxlock-*.whl")
        self.site, self.home, self.here = base / "site", base / "home", base / "here"
        for folder in (self.home, self.here):
            folder.mkdir()
        with zipfile.ZipFile(wheel) as file:
            file.extractall(self.site)
        # Verilator's runtime is none of the package: the checkout's own is taken, where there is one.
        cache = Path(self.python("-c", "import fluxlock.base.paths as p; print(p.BUILD)").stdout.strip())
        cache.mkdir(parents=True)
        (BUILD / "runtime").mkdir(parents=True, exist_ok=True)
        (cache / "runtime").symlink_to(BUILD / "runtime")

    def __call__(self, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
        """Run `fluxlock` with arguments."""
        return self.python("-m", "fluxlock", *arguments, **environment)

    def python(self, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
        """Run Python with arguments in the empty folder."""
        command, env = [sys.executable, *arguments], {**self.environment(), **environment}
        return subprocess.run(command, cwd=self.here, env=env, capture_output=True, text=True, check=False, timeout=600)

    def environment(self) -> dict[str, str]:
        """Variables of a user's shell, whose home is empty."""
        env = {"PATH": os.environ["PATH"], "HOME": str(self.home), "PYTHONPATH": str(self.site)}
        # Where Python keeps what it has compiled of the dependencies.
        return env | {name: os.environ[name] for name in ("PYTHONPYCACHEPREFIX",) if name in os.environ}


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Installed:
    return Installed(tmp_path_factory.mktemp("wheel"))


def test_place(installed: Installed) -> None:
    """The package reads what lies in it, and builds in the user's cache folder.

    Verifies: PACKAGE-1
    """
    done = installed.python("-c", "import fluxlock.base.paths as p; print(p.ROOT); print(p.BUILD)")
    root, build = done.stdout.splitlines()
    assert Path(root) == installed.site / "fluxlock" / "share"
    assert Path(build).parent == installed.home / ".cache" / "fluxlock"


def test_sources_are_those_of_the_checkout(installed: Installed) -> None:
    """A worker with the wheel and one with the checkout that it was made from know each other by one hash.

    Verifies: PACKAGE-9
    """
    done = installed.python("-c", "from fluxlock.workers import sources; print(sources())")
    assert done.stdout.strip() == sources()


def test_shipped_by_name(installed: Installed) -> None:
    """A shipped file is found by its name in the checkout from any folder; one that lies here goes first.

    Verifies: PACKAGE-2
    """
    done = installed("motor", "info", "motors/spindle-2pp.toml")
    assert done.returncode == 0 and "Spindle 48 V" in done.stdout
    own = installed.here / "motors" / "spindle-2pp.toml"
    own.parent.mkdir()
    text = (ROOT / "motors" / "spindle-2pp.toml").read_text(encoding="utf-8")
    own.write_text(text.replace("Spindle 48 V", "Another one"), encoding="utf-8")
    assert "Another one" in installed("motor", "info", "motors/spindle-2pp.toml").stdout
    shutil.rmtree(own.parent)


def test_runs(installed: Installed) -> None:
    """A run builds chip and firmware from the package alone; result and plots lie in the current folder.

    Verifies: PACKAGE-3
    """
    short = ["duration_s=0.002", "expect=[]", "window=[]", "event=[]"]
    done = installed("run", "scenarios/spinning.toml", *(word for text in short for word in ("--set", text)))
    assert done.returncode == 0, done.stderr
    folder = installed.here / "build" / "spinning"
    assert {"result.json", "trace.npz", "overview.png"} <= {path.name for path in folder.iterdir()}
    result = json.loads((folder / "result.json").read_text(encoding="utf-8"))
    assert result["run"]["cycles"] == 100_000
    assert not list(installed.site.rglob("build"))


def test_sweep_that_loses_a_worker(installed: Installed) -> None:
    """24 points on two Dask workers, one of which is killed half-way, are bit for bit those of the process pool.

    Verifies: PACKAGE-9
    """
    (installed.here / "sweep.py").write_text(SWEEP, encoding="utf-8")
    with dask_workers(installed.here, 2, installed.environment()) as dask:
        lost = installed.python("sweep.py", dask.address(), str(dask.workers[0].pid))
        assert lost.returncode == 0, lost.stderr
        assert dask.workers[0].poll() is not None and dask.workers[1].poll() is None
    rows = json.loads(lost.stdout)
    assert [(row["point"], row["status"]) for row in rows] == [(point, "right") for point in range(24)]
    assert len({row["held.speed_rpm.mean"] for row in rows}) > 12
    assert lost.stdout == installed.python("sweep.py").stdout


@pytest.mark.parametrize(
    ("package", "command"),
    [
        ("fluxverify", ["regression"]),
        ("fluxverify", ["campaign"]),
        ("fluxverify", ["fuzz"]),
        ("fluxverify", ["figures", "six-step"]),
        ("fluxverify", ["mutate"]),
        ("fluxlock", ["population", "run"]),
    ],
)
def test_commands_of_the_checkout(installed: Installed, package: str, command: list[str]) -> None:
    """Commands that need tests, records or pages are refused by name in one line.

    Verifies: PACKAGE-4
    """
    done = installed.python("-m", package, *command)
    assert done.returncode == 2 and len(done.stderr.splitlines()) == 1
    assert done.stderr.startswith(f"error: {package} {command[0]}: needs a checkout")


def test_no_compiler(installed: Installed, tmp_path: Path) -> None:
    """What the machine lacks is named with the package that brings it, before anything is built.

    Verifies: PACKAGE-5
    """
    for name in ("sh", "uname", "getconf", "tr", "wc", "dirname", "perl"):
        (tmp_path / name).symlink_to(shutil.which(name) or name)
    done = installed("run", "scenarios/spinning.toml", PATH=str(tmp_path))
    assert done.returncode == 2
    assert done.stderr.splitlines() == [
        "error: this machine lacks:",
        "  make: install make (Debian, Ubuntu) or make (Fedora)",
        "  g++: install g++ (Debian, Ubuntu) or gcc-c++ (Fedora), or set CXX",
    ]


def test_home_with_a_space(installed: Installed, tmp_path: Path) -> None:
    """A cache folder in which the tools cannot build is refused by name.

    Verifies: PACKAGE-5
    """
    done = installed("run", "scenarios/spinning.toml", HOME=str(tmp_path / "my home"))
    assert done.returncode == 2 and "my home" in done.stderr and len(done.stderr.splitlines()) == 1
