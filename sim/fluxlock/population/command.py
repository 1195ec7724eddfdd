# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""`fluxlock population run`: progress, tables, `build/population/<method>.json` or `<method>-rest.json`."""

from __future__ import annotations

import json
from collections.abc import Sequence
from functools import partial

from rich.console import Console
from rich.table import Table

from fluxlock.base.progress import counting_bars
from fluxlock.base.writable import check_file
from fluxlock.population.draw import Population
from fluxlock.population.rest import BACK_DEG
from fluxlock.population.run import FOLDER, OUTCOMES, WRONG, Row, outcomes, run_lives
from fluxlock.population.table import EXAMPLES, count, deciles, groups
from fluxlock.sources import source_hashes


def _tables(rows: Sequence[Row], title: str) -> list[Table]:
    by_reason = Table(title=f"{title}: reasons", title_justify="left")
    for header in ("outcome", "first reason", "lives", "beside others", "machines", "example"):
        by_reason.add_column(header, overflow="fold")
    for group in groups(rows):
        some = " ".join(map(str, group.indices[:EXAMPLES]))
        by_reason.add_row(group.outcome, group.kind, str(len(group.indices)), str(group.also), some, group.example)
    by_inductance = Table(title=f"{title}: by decile of the inductance", title_justify="left")
    for header in ("inductance, pu", *OUTCOMES):
        by_inductance.add_column(header)
    for low, high, *counts in deciles(rows):
        by_inductance.add_row(f"{low:.3f} … {high:.3f}", *map(str, counts))
    return [by_reason, by_inductance]


def starts_text(rows: Sequence[Row]) -> str:
    """How the starts of lives from rest went, beside right and wrong."""
    ran = [row for row in rows if "allowed_s" in row]
    if not ran:
        return "no life has run"
    late = sum(row["lock_s"] is None or row["lock_s"] > row["allowed_s"] for row in ran)
    back = [float(row["back_deg"]) for row in ran]
    far = sum(deg > BACK_DEG for deg in back)
    return (
        f"first starts: {100 * (1 - late / len(ran)):.1f} % locked in time, {100 * (1 - far / len(ran)):.1f} % turned "
        f"back by at most {BACK_DEG:g} degrees after the alignment, all by at most {max(back):.0f}"
    )


def run_population(
    methods: Sequence[Population], seed: int, indices: Sequence[int], jobs: int, rest: bool = False
) -> bool:
    """Run the lives, print tables, write the documents; False if a life is wrong."""
    console, good = Console(), True
    for method in methods:
        kind = f"{method}-rest" if rest else method
        path = FOLDER / (f"{kind}-from-{indices[0]}.json" if indices[0] else f"{kind}.json")
        check_file(path)
        sources = source_hashes()  # before the runs: the checkout may change while they last
        with counting_bars() as progress:
            task = progress.add_task(kind, total=len(indices))
            rows = run_lives(method, seed, indices, jobs, partial(progress.update, task, advance=1), rest)
        document = {"method": method, "rest": rest, "seed": seed, "sources": sources, "rows": rows}
        path.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
        for table in _tables(rows, f"{kind}, seed {seed}"):
            console.print(table)
        counts = {outcome: count(rows, outcome) for outcome in outcomes(method)}
        text = ", ".join(f"{number} {outcome}" for outcome, number in counts.items())
        if rest:
            console.print(f"{kind}: {starts_text(rows)}", highlight=False, soft_wrap=True)
        console.print(f"{kind}: {len(rows)} lives, {text}; written: {path}", highlight=False, soft_wrap=True)
        good = good and not counts[WRONG]
    return good
