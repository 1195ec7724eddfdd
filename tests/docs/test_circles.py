# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""No circle of imports, and the check that says so notices one."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from fluxlock.paths import ROOT


def lint(folder: Path) -> subprocess.CompletedProcess[str]:
    """The contracts of pyproject.toml on the package of a folder."""
    tool = Path(sys.executable).with_name("lint-imports")
    line = [str(tool), str(ROOT / "pyproject.toml"), "--no-cache", "--no-logo"]
    env = {**os.environ, "PYTHONPATH": str(folder)}
    return subprocess.run(line, cwd=folder, env=env, capture_output=True, text=True, check=False)


def test_no_circles() -> None:
    """The package as it is.

    Verifies: CHK-03
    """
    done = lint(ROOT / "sim")
    assert done.returncode == 0, done.stdout
    assert "No circles KEPT" in done.stdout


@pytest.mark.parametrize(
    ("module", "line", "named"),
    [
        ("plant/emf.py", "import fluxlock.cosim.run", "No cycles are allowed in fluxlock."),
        (
            "regression/runner.py",
            "from fluxlock.regression import sets",
            "No cycles are allowed in fluxlock.regression.",
        ),
        ("progress.py", "def late():\n    from fluxlock.analysis import metrics", "No cycles are allowed in fluxlock."),
    ],
)
def test_a_planted_circle_is_found(module: str, line: str, named: str, tmp_path: Path) -> None:
    """Between packages, within one, and inside a function: each fails the check by name.

    Verifies: CHK-03
    """
    shutil.copytree(ROOT / "sim" / "fluxlock", tmp_path / "fluxlock", ignore=shutil.ignore_patterns("*.pyc", "page"))
    planted = tmp_path / "fluxlock" / module
    planted.write_text(planted.read_text(encoding="utf-8") + f"\n\n{line}\n", encoding="utf-8")
    done = lint(tmp_path)
    assert done.returncode == 1 and named in done.stdout, done.stdout
