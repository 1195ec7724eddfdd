# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""No circle of imports, none from the product to its verification, and the check that says so notices one."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from fluxlock.base.paths import ROOT


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
    assert "The product does not know its verification KEPT" in done.stdout


@pytest.mark.parametrize(
    ("module", "line", "named"),
    [
        ("fluxlock/plant/emf.py", "import fluxlock.cosim.run", "No cycles are allowed in fluxlock."),
        (
            "fluxverify/regression/runner.py",
            "from fluxverify.regression import sets",
            "No cycles are allowed in fluxverify.regression.",
        ),
        (
            "fluxlock/base/progress.py",
            "def late():\n    from fluxlock.results import metrics",
            "No cycles are allowed in fluxlock.",
        ),
        ("fluxlock/api.py", "import fluxverify.regression.case", "The product does not know its verification BROKEN"),
    ],
)
def test_a_planted_breach_is_found(module: str, line: str, named: str, tmp_path: Path) -> None:
    """A circle between packages, within one, inside a function, and the product that asks its verification: by name.

    Verifies: CHK-03
    """
    for package in ("fluxlock", "fluxverify"):
        shutil.copytree(ROOT / "sim" / package, tmp_path / package, ignore=shutil.ignore_patterns("*.pyc", "page"))
    planted = tmp_path / module
    planted.write_text(planted.read_text(encoding="utf-8") + f"\n\n{line}\n", encoding="utf-8")
    done = lint(tmp_path)
    assert done.returncode == 1 and named in done.stdout, done.stdout
