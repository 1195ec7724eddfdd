# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The wheel as a user installs it: an environment of its own, an empty folder, an empty home, the demo.

Not collected by name, since it takes packages from the index: `make test-wheel` runs it. PYTHON: of the environment.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from fluxlock.base.paths import ROOT

LEFT = {"result.json", "trace.npz", "overview.png", "zoom.png"}


def test_demo(tmp_path: Path) -> None:
    """Wheel, installation and demo, which ends right, with its plots in the current folder."""
    python = os.environ.get("PYTHON") or sys.executable
    uv = str(Path(sys.executable).with_name("uv"))
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(tmp_path)]
    subprocess.run(command, cwd=ROOT, check=True)
    (wheel,) = tmp_path.glob("fluxlock-*.whl")
    home, here, made = (tmp_path / name for name in ("home", "here", "env"))
    for folder in (home, here):
        folder.mkdir()
    subprocess.run([uv, "venv", "--quiet", "--python", python, str(made)], check=True)
    subprocess.run([uv, "pip", "install", "--quiet", "--python", str(made / "bin" / "python"), str(wheel)], check=True)
    environment = {"PATH": os.environ["PATH"], "HOME": str(home)}
    done = subprocess.run([str(made / "bin" / "fluxlock"), "demo"], cwd=here, env=environment, check=False)
    assert done.returncode == 0
    assert {path.name for path in (here / "build" / "demo").iterdir()} >= LEFT
    assert [path.name for path in here.iterdir()] == ["build"]
