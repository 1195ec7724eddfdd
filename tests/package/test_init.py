# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A folder for a drive of one's own."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import matplotlib as mpl
import pytest
from typer.testing import CliRunner

import fluxlock
from fluxlock.cli import app
from fluxlock.config.json_schema import json_schema


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    made = tmp_path / "my-drive"
    done = CliRunner().invoke(app, ["init", str(made)])
    assert done.exit_code == 0
    named = re.findall(r"(\S+\.(?:toml|py))(?:;|\n|$)", done.output.partition("next: ")[2])
    assert [Path(path).name for path in named] == ["motor.toml", "scenario.toml", "test_drive.py"], done.output
    assert all(Path(path).is_file() for path in named)
    return made


def test_files_run(folder: Path) -> None:
    """The scenario names the files beside it and passes every check; each file names its schema, which is there.

    Verifies: PACKAGE-10
    """
    scenario = fluxlock.load_scenario(folder / "scenario.toml")
    assert scenario.sources.motor == str(folder / "motor.toml") and scenario.sources.inverter == str(
        folder / "inverter.toml"
    )
    for kind in ("motor", "inverter", "scenario"):
        named = re.match(r"#:schema (.*)\n", (folder / f"{kind}.toml").read_text(encoding="utf-8"))
        assert named is not None and json.loads((folder / named[1]).read_text(encoding="utf-8")) == json_schema(kind)


def test_notebook(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The notebook's cells run one after the other.

    Verifies: PACKAGE-10
    """
    mpl.use("Agg")
    monkeypatch.chdir(folder)
    book = json.loads((folder / "first.ipynb").read_text(encoding="utf-8"))
    assert book["nbformat"] == 4
    names: dict[str, object] = {}
    for cell in book["cells"]:
        if cell["cell_type"] == "code":
            exec(compile(cell["source"], "cell", "exec"), names)
    assert isinstance(names["run"], fluxlock.Run) and names["run"].verdict.passed
    assert isinstance(names["made"], fluxlock.Sweep) and names["made"].count("right") == 3


def test_cocotb(folder: Path) -> None:
    """The cocotb test passes in its folder by pytest alone.

    Verifies: PACKAGE-10
    """
    env = {name: value for name, value in os.environ.items() if not name.startswith(("PYTEST", "COCOTB"))}
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider"]
    done = subprocess.run(command, cwd=folder, env=env, capture_output=True, text=True, check=False)
    assert done.returncode == 0 and "1 passed" in done.stdout, done.stdout[-3000:]


def test_refused(folder: Path, tmp_path: Path) -> None:
    """A folder that is not empty, and a file in its place, stay as they are.

    Verifies: PACKAGE-10
    """
    before = sorted(folder.rglob("*"))
    (tmp_path / "file").touch()
    for name in ("my-drive", "file"):
        with pytest.raises(fluxlock.ConfigError, match="not empty: name a new folder"):
            CliRunner().invoke(app, ["init", str(tmp_path / name)], catch_exceptions=False)
    assert sorted(folder.rglob("*")) == before
