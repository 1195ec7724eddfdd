# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Coverage of the RTL by its block tests.

The tests run on builds with Verilator's counters of statements, branches and signal toggles; points of all builds and
instances are added up. Every statement and branch of `EXPLAINED` that no test reaches must have its reason in
`docs/verification/uncovered.toml`: a table a file, entries with `code` (part of the line) and `reason`. A reason that
fits no uncovered line is an error.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fluxlock.base.paths import BUILD, ROOT
from fluxlock.cosim.block import COVERAGE_VARIABLE

FOLDER = BUILD / "coverage"
COUNTS = FOLDER / "rtl"
FOLDERS = COUNTS / "folders"  # whose tests were run
REASONS = ROOT / "docs" / "verification" / "uncovered.toml"
EXPLAINED = ("rtl/safety/", "rtl/common/fl_sync.sv")  # what the protection is made of


@dataclass(frozen=True, order=True)
class Point:
    """One counter: a statement, a branch or one direction of one bit."""

    file: str  # relative to the repository
    line: int
    column: int
    toggle: bool
    what: str  # "block", "if", "else", ..., or the signal and its change


def read_points(lines: Iterable[str]) -> dict[Point, int]:
    """Counts of one of Verilator's coverage files; files outside the repository's `rtl` are left out."""
    counts: dict[Point, int] = {}
    for line in lines:
        found = re.match(r"C '(.*)' (\d+)$", line)
        if not found:
            continue
        fields = dict(part.split("\x02", 1) for part in found.group(1).split("\x01") if "\x02" in part)
        path = Path(fields["f"])
        if not path.is_relative_to(ROOT / "rtl"):
            continue
        file = str(path.relative_to(ROOT))
        point = Point(file, int(fields["l"]), int(fields["n"]), fields["t"] == "toggle", fields["o"])
        counts[point] = counts.get(point, 0) + int(found.group(2))
    return counts


def merge(parts: Iterable[dict[Point, int]]) -> dict[Point, int]:
    """Sum of the counts."""
    total: dict[Point, int] = {}
    for part in parts:
        for point, count in part.items():
            total[point] = total.get(point, 0) + count
    return total


def summary(counts: dict[Point, int], code: Mapping[str, Sequence[str]]) -> dict[str, Any]:
    """By file: points and points reached of statements and toggles, the statements and signals that are not."""
    files: dict[str, Any] = {}
    for point in sorted(counts):
        empty = {"statements": [0, 0], "toggles": [0, 0], "uncovered": [], "still": []}
        entry = files.setdefault(point.file, empty)
        reached = counts[point] > 0
        numbers = entry["toggles" if point.toggle else "statements"]
        numbers[0] += 1
        numbers[1] += reached
        if not reached and point.toggle:
            entry["still"].append(f"{point.line}: {point.what}")
        elif not reached:
            text = code[point.file][point.line - 1].strip()
            entry["uncovered"].append({"line": point.line, "what": point.what, "code": text})
    return files


def explain(files: dict[str, Any], reasons: dict[str, list[dict[str, str]]]) -> tuple[list[str], list[str]]:
    """Lines of the report on the uncovered statements that need a reason, and problems."""
    report, problems = [], []
    used = []
    for file, entry in files.items():
        if not file.startswith(EXPLAINED):
            continue
        for row in entry["uncovered"]:
            reason = next((r for r in reasons.get(file, []) if r["code"] in row["code"]), None)
            used.append(reason)
            place = f"{file}:{row['line']} ({row['what']}) `{row['code']}`"
            report.append(f"- {place}: {reason['reason'] if reason else 'no reason given'}")
            if not reason:
                problems.append(f"{place}: not reached, and no reason for it in {REASONS.name}")
    for file, given in reasons.items():
        if file in files:
            problems += [
                f"{file}: reached, or not there: {r['code']!r} in {REASONS.name}" for r in given if r not in used
            ]
    return report, problems


def run_tests(folders: Sequence[str], jobs: int) -> int:
    """Run the block tests with counters; pytest's exit code."""
    COUNTS.mkdir(parents=True)
    FOLDERS.write_text("\n".join([*folders, ""]), encoding="utf-8")
    command = [sys.executable, "-m", "pytest", "-q", *(f"cocotb_tests/{folder}" for folder in folders)]
    if jobs > 1:
        command += ["-n", str(jobs)]
    return subprocess.run(command, cwd=ROOT, env=os.environ | {COVERAGE_VARIABLE: str(COUNTS)}, check=False).returncode


def read_files() -> dict[str, Any]:
    """Summary of what the tests have counted."""
    counts = merge(read_points(p.read_text(encoding="utf-8").splitlines()) for p in sorted(COUNTS.glob("*.dat")))
    sources = {file: (ROOT / file).read_text(encoding="utf-8").splitlines() for file in {p.file for p in counts}}
    return summary(counts, sources)


def read_reasons() -> dict[str, list[dict[str, str]]]:
    """Reasons for what no test reaches, by file."""
    return tomllib.loads(REASONS.read_text(encoding="utf-8"))
