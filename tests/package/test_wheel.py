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
        env = {"PATH": os.environ["PATH"], "HOME": str(self.home), "PYTHONPATH": str(self.site), **environment}
        # Where Python keeps what it has compiled of the dependencies.
        env |= {name: os.environ[name] for name in ("PYTHONPYCACHEPREFIX",) if name in os.environ}
        command = [sys.executable, *arguments]
        return subprocess.run(command, cwd=self.here, env=env, capture_output=True, text=True, check=False, timeout=600)


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
