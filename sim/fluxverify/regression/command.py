# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""`fluxverify regression`: progress, table and `build/regression.json`."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from fluxlock.base.progress import counting_bars
from fluxlock.base.writable import check_file
from fluxlock.config import ConfigError, Problem
from fluxverify.regression.case import CASES, Row, limit_text
from fluxverify.regression.record import (
    RECORD,
    changes,
    drift,
    entry_of,
    judged,
    read_record,
    vanished,
    write_record,
)
from fluxverify.regression.run import RESULT, case_of, merge, run_cases, select


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
    lines += row.get("drift", [])
    table.add_row(row["id"], escape("\n".join(lines)), "pass" if row["pass"] else "[bold red]FAIL[/]")


def run_regression(patterns: Sequence[str], quick: bool, seed: int, jobs: int) -> bool:
    """Run, print a table, write the document; False if a row misses a limit, leaves its bands or is not made."""
    names = _selected(patterns)
    check_file(RESULT)
    document = _run(names, quick, seed, jobs)
    console = Console()
    table = Table(title="regression" + (", quick: limits only" if quick else ""), title_justify="left")
    for header in ("row", "values (limits)", ""):
        table.add_column(header)
    for row in document["rows"]:
        _add(table, row)
    console.print(table)
    failed = [row for row in document["rows"] if not row["pass"]]
    gone = [] if quick else vanished([row["id"] for row in document["rows"]], names, read_record(RECORD), case_of)
    _store(document, names)
    for row in failed:
        reasons = f": {'; '.join(row['drift'])}" if row.get("drift") else ""
        console.print(f"failed: {row['id']}{reasons}", highlight=False, soft_wrap=True)
    for name in gone:
        console.print(f"failed: {name}: recorded, but its case makes it no more", highlight=False, soft_wrap=True)
    if gone or any(row.get("drift") for row in failed):
        console.print('meant so? then: fluxverify regression --accept ROW --why "..."', highlight=False)
    return not failed and not gone


def _run(names: Sequence[str], quick: bool, seed: int, jobs: int) -> dict[str, Any]:
    with counting_bars() as progress:
        task = progress.add_task("cases" if seed == 1 else f"cases, seed {seed}", total=len(names))

        def done(name: str, rows: list[dict[str, Any]]) -> None:
            progress.update(task, advance=1, description=f"finished {name}")

        return run_cases(names, quick, seed, jobs, done)


def _store(document: dict[str, Any], names: Sequence[str]) -> None:
    RESULT.write_text(json.dumps(merge(document, names), indent=2, allow_nan=False) + "\n", encoding="utf-8")
    print(f"written: {RESULT}")


def record_regression(patterns: Sequence[str], seeds: int, jobs: int) -> bool:
    """Run with seeds 1 to `seeds` and record means, scatters and bands; False if a row could not be recorded.

    A row that is outside of its bands, or misses a limit with one of the seeds, stays in the record as it is, and so do
    all rows of a case with a run that cannot be vouched for.
    """
    names = _selected(patterns)
    check_file(RESULT)
    check_file(RECORD)
    documents = {seed: _run(names, False, seed, jobs) for seed in range(seeds, 0, -1)}  # the last run's data stay
    record = read_record(RECORD)
    rows = {seed: {row["id"]: row for row in document["rows"]} for seed, document in documents.items()}
    broken: dict[str, set[int]] = {}  # case -> seeds with a failed row of their own: broken off, or not vouched for
    for seed, found in rows.items():
        for name in found.keys() - rows[1].keys():
            broken.setdefault(case_of(name), set()).add(seed)
    right = True
    for name, row in rows[1].items():
        made = {seed: found[name]["values"] for seed, found in rows.items() if name in found}
        missed = {seed for seed, found in rows.items() if name not in found or not _limits_hold(found[name])}
        missed |= broken.get(case_of(name), set())
        entry = entry_of(row, row["git_revision"], made, record.get(name, {}).get("why", "first recorded"))
        means = {value: told["value"] for value, told in entry["values"].items()}
        left = drift({**row, "values": means}, record) if name in record else []
        right = right and not missed and not left
        if missed:
            seeds_text = ", ".join(map(str, sorted(missed)))
            print(f"not recorded: {name}: limits missed, no row or no run to vouch for with seed {seeds_text}")
        elif left:
            print(f"not recorded: {name}: mean of {seeds} seeds: {'; '.join(left)}")
        else:
            print(f"recorded: {name}: {changes(record.get(name), entry)}")
            record[name] = entry
            for seed, found in rows.items():
                for line in drift(found[name], record):
                    print(f"  its band does not hold seed {seed}: {line}")
    write_record(record, RECORD)
    print(f"written: {RECORD}; the page follows with python -m fluxverify.docs.regression")
    document = documents[1]
    document["rows"] = [judged({**row, "pass": _limits_hold(row)}, record) for row in document["rows"]]
    _store(document, names)
    return right


def _limits_hold(row: dict[str, Any]) -> bool:
    limits = {name: (limit["min"], limit["max"]) for name, limit in row["limit"].items()}
    return not Row(row["id"], {}, row["values"], limits).misses()


def accept_rows(patterns: Sequence[str], why: str) -> None:
    """Record the rows of the last run whose names begin so and that have left their bands, with the reason.

    ConfigError for a row without a result, one that misses a limit, and where there is nothing to accept.
    """
    if not why.strip():
        raise ConfigError(
            [Problem("regression", "--why", "say why the values may change; the record keeps the reason")]
        )
    check_file(RECORD)
    if not RESULT.exists():
        raise ConfigError([Problem(str(RESULT), "", "is missing: run fluxverify regression with the row's case first")])
    document = json.loads(RESULT.read_text(encoding="utf-8"))
    if document["quick"]:
        text = "holds short versions; the record is of full length: run fluxverify regression without --quick first"
        raise ConfigError([Problem(str(RESULT), "", text)])
    record = read_record(RECORD)
    select([])  # registers the cases
    made = {row["id"]: row for row in document["rows"]}
    ran = {case_of(name) for name in made}
    problems, accepted = [], []
    for pattern in patterns:
        names = [name for name in made if name.startswith(pattern)]
        gone = [
            name for name in record if name.startswith(pattern) and name not in made and case_of(name) in {*ran, ""}
        ]
        moved = [name for name in names if drift(made[name], record)]
        if not moved and not gone:
            text = "is within its bands" if names else f"has no result in {RESULT}: run its case first"
            problems.append(Problem("regression --accept", pattern, text))
        problems += [
            Problem("regression --accept", name, "misses a limit; accepting a value does not lift its limit")
            for name in moved
            if not _limits_hold(made[name])
        ]
        accepted += moved + gone
    if problems:
        raise ConfigError(problems)
    for name in dict.fromkeys(accepted):
        if name not in made:
            del record[name]
            print(f"accepted: {name}: gone")
            continue
        row = made[name]
        entry = entry_of(row, row["git_revision"], {row["seed"]: row["values"]}, why.strip())
        print(f"accepted: {name}: {changes(record.get(name), entry)}")
        record[name] = entry
        row |= {"drift": [], "pass": True}
    write_record(record, RECORD)
    RESULT.write_text(json.dumps(document, indent=2, allow_nan=False) + "\n", encoding="utf-8")
    print(f"written: {RECORD}; the page follows with python -m fluxverify.docs.regression")
