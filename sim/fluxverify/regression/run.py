# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Runs the sets of cases side by side: rows of all cases, judged against their limits and the record."""

from __future__ import annotations

import json
import traceback
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from fluxlock.base.paths import BUILD
from fluxlock.base.writable import refusal
from fluxlock.results.result import tool_versions
from fluxlock.workers import side_by_side
from fluxverify.regression.case import Number, Row
from fluxverify.regression.origin import kept, origin
from fluxverify.regression.record import judged, read_record
from fluxverify.regression.runner import RunFailed, Runner, prepare_runs
from fluxverify.regression.sets import CASES

SCHEMA_VERSION = 1
RESULT = BUILD / "regression.json"


def _rows(case_id: str, quick: bool, seed: int) -> list[dict[str, Any]]:
    """All rows of a case; a case that breaks off gives one failed row that says why."""
    rows: list[Row] = []
    runner = Runner(case_id, quick, seed)
    try:
        rows.extend(CASES[case_id].body(runner))
    except RunFailed as error:
        rows.append(Row(case_id, {}, {"completed": 0}, {"completed": (1, 1)}, str(error)))
    except Exception as error:
        reason = refusal(error) or traceback.format_exc()
        rows.append(Row(case_id, {}, {"completed": 0}, {"completed": (1, 1)}, reason))
    rows.extend(vouching(case_id, runner))
    return [row.as_json() for row in rows]


def vouching(case_id: str, runner: Runner) -> list[Row]:
    """A row that fails and says why, if a run of the case cannot be vouched for."""
    if not runner.unvouched:
        return []
    values: dict[str, Number] = {"unvouched": len(runner.unvouched)}
    return [Row(f"{case_id}/vouched", {}, values, {"unvouched": (0, 0)}, "; ".join(runner.unvouched))]


def select(patterns: Sequence[str]) -> list[str]:
    """Ids of the cases that begin with one of the patterns; all without a pattern."""
    return [name for name in CASES if not patterns or any(name.startswith(p) for p in patterns)]


def run_cases(
    names: Iterable[str],
    quick: bool = False,
    seed: int = 1,
    jobs: int = 2,
    done: Callable[[str, list[dict[str, Any]]], None] | None = None,
) -> dict[str, Any]:
    """Run cases in `jobs` processes and return the document; done: called with every finished case's rows.

    Rows of full length are judged against the record too.
    """
    order = list(names)
    record = {} if quick else read_record()
    made = origin(seed)  # before the runs: the checkout may change while they last
    rows: dict[str, list[dict[str, Any]]] = {}

    def store(name: str, found: list[dict[str, Any]]) -> None:
        found = found if quick else [judged(row, record) for row in found]
        rows[name] = found
        if done is not None:
            done(name, found)

    prepare_runs(quick)
    first = sorted(order, key=lambda name: not CASES[name].long)
    side_by_side(partial(_rows, quick=quick, seed=seed), first, jobs, store)
    document = {"schema": SCHEMA_VERSION, "quick": quick, **made, "tool_versions": tool_versions()}
    return document | {"rows": [{**row, **made} for name in order for row in rows[name]]}


def merge(document: dict[str, Any], names: Sequence[str], path: Path = RESULT) -> dict[str, Any]:
    """Keep the rows of cases other than `names` that stand in the file already (same length of run)."""
    if path.exists():
        before = json.loads(path.read_text(encoding="utf-8"))
        if before.get("schema") == SCHEMA_VERSION and before.get("quick") == document["quick"]:
            others = [row for row in before["rows"] if case_of(row["id"]) not in names]
            document["rows"] += kept(others, "id", lambda name: case_of(name) in CASES, "case", path)
            order = list(CASES)
            document["rows"].sort(key=lambda row: order.index(case_of(row["id"])))
    return document


def case_of(row_id: str) -> str:
    """Case that a row belongs to: the longest one whose name begins its id; empty if there is none."""
    return max((name for name in CASES if f"{row_id}/".startswith(f"{name}/")), key=len, default="")
