# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Numbers of five shipped runs in the pages: `python -m fluxverify.docs.measured`, after the runs themselves.

`make demo` leaves `build/demo`; `fluxlock run scenarios/NAME.toml` leaves `build/NAME` of the other four. Their results
go to `docs/verification/measured.md` and, as caption and scope, to the README.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from fluxlock.base.paths import ROOT
from fluxlock.base.writable import guarded
from fluxlock.digits import thousands
from fluxlock.results import scope
from fluxlock.theory.six_step.cli import read_trace

PAGE = ROOT / "docs" / "verification" / "measured.md"
README = ROOT / "README.md"
IMAGE = ROOT / "docs" / "images" / "scope.svg"
RUNS = ("demo", "slow-down", "own-spindle", "own-pump", "own-outrunner")
CAPTION = re.compile(r"^The simulated rotor turns at .*$", re.MULTILINE)
Result = dict[str, Any]


def errors(found: dict[str, float]) -> str:
    """Mean, rms and largest error of a window, deg."""
    return " / ".join(f"{round(found[key], 3) + 0.0:.3f}" for key in ("mean", "rms", "max"))


# Row of the page -> what its column says of a window.
ROWS: dict[str, Callable[[Result], str]] = {
    "speed, min … max (r/min)": lambda m: f"{m['speed_rpm']['min']:.0f} … {m['speed_rpm']['max']:.0f}",
    "crossing error, mean / rms / max (deg)": lambda m: errors(m["zcp_error_deg"]),
    "commutation error, mean / rms / max (deg)": lambda m: errors(m["commutation_error_deg"]),
    "freewheel angle, mean / max (deg)": lambda m: " / ".join(f"{m['freewheel_deg'][k]:.2f}" for k in ("mean", "max")),
    "phase current, peak-to-peak (A)": lambda m: f"{m['phase_current_pp_a']:.1f}",
    "late crossings": lambda m: str(m["late_crossings"]),
}


def filled(text: str, label: str, keep: int, cells: list[str]) -> str:
    """The page with new cells behind the first `keep` ones of the one row that has `label`."""
    lines = text.split("\n")
    found = [index for index, line in enumerate(lines) if line.startswith("|") and label in line]
    if len(found) != 1:
        raise ValueError(f"{PAGE.relative_to(ROOT)}: {len(found)} rows of `{label}`")
    kept = lines[found[0]].strip("| ").split(" | ")[:keep]
    lines[found[0]] = f"| {' | '.join([*kept, *cells])} |"
    return "\n".join(lines)


def page(text: str, results: dict[str, Result]) -> str:
    """The page with the numbers of the runs."""
    demo = results["demo"]["metrics"]
    windows = (demo["steady"], demo["loaded"], results["slow-down"]["metrics"]["slow"])
    for label, told in ROWS.items():
        text = filled(text, label, 1, [told(window) for window in windows])
    for name in RUNS[2:]:
        result = results[name]
        steady = result["metrics"]["steady"]
        mean, rms = steady["speed_rpm"]["mean"], steady["commutation_error_deg"]["rms"]
        target = max(event.get("speed_rpm") or 0 for event in result["scenario"]["settings"]["event"])
        whole, tenths = divmod(round(mean * 10), 10)
        speeds = f"{thousands(target)} / {thousands(whole)}.{tenths}"
        text = filled(text, f"scenarios/{name}.toml", 2, [speeds, f"{rms:.3f}"])
    step = results["demo"]["run"]["isr"]["control"]
    clocks = " / ".join(f"{step[key]:.0f}" for key in ("min", "mean", "max"))
    return filled(text, "control step, min / mean / max", 1, [clocks, "`make demo`"])


def read(folder: Path) -> Result:
    """The result of a run; ValueError names the command that makes it, or its failure."""
    try:
        result: Result = json.loads((folder / "result.json").read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise ValueError(f"{folder} is missing: .venv/bin/fluxlock run scenarios/{folder.name}.toml") from None
    if not result["verdict"]["passed"]:
        raise ValueError(f"{folder}: the run has failed: {'; '.join(result['verdict']['lines'])}")
    return result


def write() -> None:
    """Page, caption and scope."""
    folders = {name: ROOT / "build" / name for name in RUNS}
    results = {name: read(folder) for name, folder in folders.items()}
    data = read_trace(folders["demo"] / "trace.npz")
    text = README.read_text(encoding="utf-8")
    PAGE.write_text(page(PAGE.read_text(encoding="utf-8"), results), encoding="utf-8")
    README.write_text(CAPTION.sub(scope.caption(data, results["demo"]), text, count=1), encoding="utf-8")
    for file, moving in ((IMAGE, True), (IMAGE.with_name("scope-still.svg"), False)):
        file.write_text(scope.svg(data, results["demo"], moving), encoding="utf-8")
    print(f"written: {PAGE}, {README}, {IMAGE}, scope-still.svg")


def main() -> int:
    """Write them; exit code 1 if a run is missing or has failed."""
    try:
        write()
    except ValueError as error:
        print(f"error: {error}")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(guarded(main))
