# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""`fluxlock population run`: progress, tables, `build/population/<method>.json`."""

from __future__ import annotations

import json
from collections.abc import Sequence
from functools import partial

from rich.console import Console
from rich.table import Table

from fluxlock.base.progress import counting_bars
from fluxlock.base.writable import check_file
from fluxlock.population.draw import Population
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


def run_population(methods: Sequence[Population], seed: int, indices: Sequence[int], jobs: int) -> bool:
    """Run the lives, print tables, write the documents; False if a life is wrong."""
    console, good = Console(), True
    for method in methods:
        path = FOLDER / (f"{method}-from-{indices[0]}.json" if indices[0] else f"{method}.json")
        check_file(path)
        sources = source_hashes()  # before the runs: the checkout may change while they last
        with counting_bars() as progress:
            task = progress.add_task(method, total=len(indices))
            rows = run_lives(method, seed, indices, jobs, partial(progress.update, task, advance=1))
        document = {"method": method, "seed": seed, "sources": sources, "rows": rows}
        path.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
        for table in _tables(rows, f"{method}, seed {seed}"):
            console.print(table)
        counts = {outcome: count(rows, outcome) for outcome in outcomes(method)}
        text = ", ".join(f"{number} {outcome}" for outcome, number in counts.items())
        console.print(f"{method}: {len(rows)} lives, {text}; written: {path}", highlight=False, soft_wrap=True)
        good = good and not counts[WRONG]
    return good
