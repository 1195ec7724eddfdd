# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Coverage of C and Python by the tests on the host.

The tests of `TESTS` run under coverage.py, several processes side by side; the C of their host libraries is compiled by
the machine's GCC with counters (`fluxlock.firmware.toolchain`), which gcovr reads. What runs inside the simulator is
not counted: no chip takes part.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from fluxlock.base.paths import ROOT
from fluxlock.firmware.toolchain import COVERAGE_VARIABLE
from fluxverify.coverage.rtl import FOLDER

C_COUNTS = FOLDER / "c"
PYTHON_COUNTS = FOLDER / "python"
# The long ones first. Left out: what runs whole chips, proofs, and the mutation score's own test.
TESTS = (
    "firmware",
    "injection",
    "plant",
    "results",
    "theory",
    "canopen",
    "config",
    "commission",
    "first_start",
    "figures",
    "docs",
    "coverage",
    "flash",
    "registers",
    "regression",
    "edge",
    "replay",
    "wiring",
)
FILES_A_PROCESS = 6


def parts(folders: Iterable[str] = TESTS) -> list[list[str]]:
    """Test files, so many for one process."""
    found = []
    for folder in folders:
        files = sorted(str(p.relative_to(ROOT)) for p in (ROOT / "tests" / folder).glob("test_*.py"))
        found += [files[i : i + FILES_A_PROCESS] for i in range(0, len(files), FILES_A_PROCESS)]
    return found


def _run_part(number: int, files: list[str]) -> bool:
    environment = os.environ | {COVERAGE_VARIABLE: str(C_COUNTS), "COVERAGE_FILE": str(PYTHON_COUNTS / "counts")}
    command = [sys.executable, "-m", "coverage", "run", "-m", "pytest", "-q", "-p", "no:cacheprovider", *files]
    log = FOLDER / f"tests-{number}.log"
    with log.open("w") as out:
        done = subprocess.run(command, cwd=ROOT, env=environment, stdout=out, stderr=out, check=False)
    if done.returncode:
        print(f"error: tests failed: {log}", file=sys.stderr)
    return not done.returncode


def run_tests(jobs: int) -> bool:
    """Run the tests with counters; True if all passed."""
    for folder in (C_COUNTS, PYTHON_COUNTS):
        folder.mkdir(parents=True)
    with ThreadPoolExecutor(jobs) as pool:
        return all(list(pool.map(_run_part, *zip(*enumerate(parts()), strict=True))))


def _tool(*arguments: str) -> None:
    environment = os.environ | {"COVERAGE_FILE": str(PYTHON_COUNTS / "counts")}
    done = subprocess.run(
        [sys.executable, "-m", *arguments], cwd=ROOT, env=environment, capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise RuntimeError(f"{arguments[0]} failed:\n{done.stdout}{done.stderr}")


def read_c() -> dict[str, list[int]]:
    """By file of `sw`: branches, branches taken, lines, lines reached; writes gcovr's pages."""
    out = C_COUNTS / "summary.json"
    pages = ("--html-nested", str(C_COUNTS / "index.html"))
    _tool("gcovr", "--root", str(ROOT), "--filter", "sw/", "--json-summary", str(out), *pages, str(C_COUNTS))
    return c_files(json.loads(out.read_text(encoding="utf-8")))


def c_files(summary: Mapping[str, Any]) -> dict[str, list[int]]:
    """Numbers of gcovr's summary, functions of headers included."""
    keys = ("branch_total", "branch_covered", "line_total", "line_covered")
    files = sorted(summary["files"], key=lambda row: str(row["filename"]))
    return {row["filename"]: [row[key] for key in keys] for row in files}


def read_python() -> dict[str, list[int]]:
    """By file of `sim/fluxlock`: the same numbers; writes coverage.py's pages."""
    out = PYTHON_COUNTS / "summary.json"
    if any(PYTHON_COUNTS.glob("counts.*")):
        _tool("coverage", "combine", "--quiet", str(PYTHON_COUNTS))
    _tool("coverage", "json", "--quiet", "-o", str(out))
    _tool("coverage", "html", "--quiet", "-d", str(PYTHON_COUNTS))
    return python_files(json.loads(out.read_text(encoding="utf-8")))


def python_files(report: Mapping[str, Any]) -> dict[str, list[int]]:
    """Numbers of coverage.py's report."""
    keys = ("num_branches", "covered_branches", "num_statements", "covered_lines")
    return {file: [row["summary"][key] for key in keys] for file, row in sorted(report["files"].items())}
