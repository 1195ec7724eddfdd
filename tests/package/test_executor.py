# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Commands of many runs above the one executor."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

from fluxlock.base.paths import ROOT

SIM = ROOT / "sim"
EXECUTOR = SIM / "fluxlock" / "workers.py"
HOMES = {
    "regression": SIM / "fluxverify" / "regression" / "run.py",
    "figures": SIM / "fluxverify" / "figures" / "command.py",
    "population": SIM / "fluxlock" / "population" / "run.py",
    "campaign": SIM / "fluxverify" / "campaign" / "run.py",
    "mutation": SIM / "fluxverify" / "mutation" / "run.py",
    "the executor": EXECUTOR,
}
MOST_LINES = 30
POOL = re.compile(r"\b(ProcessPoolExecutor|Pool\(|ProcessPool|joblib|distributed\.Client)")


def lines_of(path: Path) -> dict[str, int]:
    """Lines of each function and method of a file."""
    functions = (ast.FunctionDef, ast.AsyncFunctionDef)
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return {f.name: (f.end_lineno or 0) - f.lineno + 1 for f in ast.walk(tree) if isinstance(f, functions)}


def table() -> dict[str, tuple[int, list[str]]]:
    """Column "now" of the page: lines, and the functions that have them."""
    text = (ROOT / "docs" / "develop" / "index.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| ([\w ]+) \| [^|]+ \| (\d+): ([^|]*) \|$", text, re.MULTILINE)
    return {name: (int(count), re.findall(r"`(\w+)`", functions)) for name, count, functions in rows}


@pytest.mark.parametrize("command", HOMES)
def test_lines_of_the_page(command: str) -> None:
    """The page states how long the functions are, and none but the executor's take more than 30 lines.

    Verifies: PACKAGE-12
    """
    stated, functions = table()[command]
    lines = lines_of(HOMES[command])
    assert functions and sum(lines[name] for name in functions) == stated
    assert stated <= MOST_LINES or HOMES[command] == EXECUTOR
    calls = "side_by_side(" in HOMES[command].read_text(encoding="utf-8")
    assert calls and set(table()) == set(HOMES)


def test_one_executor() -> None:
    """No other module begins a pool of processes, or asks a scheduler.

    Verifies: PACKAGE-12
    """
    found = [path for path in SIM.rglob("*.py") if POOL.search(path.read_text(encoding="utf-8"))]
    assert found == [EXECUTOR]
