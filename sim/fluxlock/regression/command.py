"""`fluxlock regression`: progress, table and `build/regression.json`."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from rich.console import Console
from rich.table import Table

from fluxlock.config import ConfigError, Problem
from fluxlock.progress import counting_bars
from fluxlock.regression.case import CASES, limit_text
from fluxlock.regression.runner import RESULT, merge, run_cases, select
from fluxlock.writable import check_file


def _selected(patterns: Sequence[str]) -> list[str]:
    names = select(patterns)
    missing = [p for p in patterns if not any(name.startswith(p) for name in names)]
    if missing:
        known = ", ".join(CASES)
        raise ConfigError([Problem("regression", p, f"no case begins like this; cases: {known}") for p in missing])
    return names


def list_cases(patterns: Sequence[str]) -> None:
    """Print the cases with their titles."""
    for name in _selected(patterns):
        print(f"{name}: {CASES[name].title}")


def _number(value: float | int | None) -> str:
    return "-" if value is None else f"{value:.5g}"


def _add(table: Table, row: dict[str, Any]) -> None:
    limits = row["limit"]
    lines = []
    for name, value in row["values"].items():
        limit = limits.get(name)
        lines.append(f"{name} {_number(value)}" + (f"  ({limit_text(limit['min'], limit['max'])})" if limit else ""))
    if row["note"] and not row["pass"]:
        lines.append(row["note"])
    table.add_row(row["id"], "\n".join(lines), "pass" if row["pass"] else "[bold red]FAIL[/]")


def run_regression(patterns: Sequence[str], quick: bool, seed: int, jobs: int) -> bool:
    """Run, print a table, write the document; False if a row misses a limit."""
    names = _selected(patterns)
    check_file(RESULT)
    console = Console()
    table = Table(title="regression" + (", quick" if quick else ""), title_justify="left")
    for header in ("row", "values (limits)", ""):
        table.add_column(header)
    with counting_bars() as progress:
        task = progress.add_task("cases", total=len(names))

        def done(name: str, rows: list[dict[str, Any]]) -> None:
            progress.update(task, advance=1, description=f"finished {name}")

        document = run_cases(names, quick, seed, jobs, done)
    for row in document["rows"]:
        _add(table, row)
    console.print(table)
    failed = [row["id"] for row in document["rows"] if not row["pass"]]
    document = merge(document, names)
    RESULT.write_text(json.dumps(document, indent=2, allow_nan=False) + "\n", encoding="utf-8")
    console.print(f"written: {RESULT}", highlight=False, soft_wrap=True)
    for name in failed:
        console.print(f"failed: {name}", highlight=False)
    return not failed
