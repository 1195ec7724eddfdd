# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Counts of a population: outcomes by decile of the inductance, reasons with examples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from fluxlock.population.run import NAMED, OUTCOMES, REFUSED, WRONG, Row

EXAMPLES = 6
DECILES = 10


@dataclass(frozen=True)
class Group:
    """Lives with the same first reason. also: lives that have it beside another one."""

    outcome: str
    kind: str
    indices: tuple[int, ...]
    also: int
    example: str


def count(rows: Sequence[Row], outcome: str) -> int:
    """Lives with an outcome."""
    return sum(row["outcome"] == outcome for row in rows)


def groups(rows: Sequence[Row]) -> list[Group]:
    """Reasons by how many lives they are the first one of, wrong before named before refused."""
    found = []
    for outcome in (WRONG, NAMED, REFUSED):
        part = [row for row in rows if row["outcome"] == outcome]
        for kind in dict.fromkeys(reason["kind"] for row in part for reason in row["reasons"]):
            first = [row for row in part if row["reasons"][0]["kind"] == kind]
            having = [row for row in part if any(reason["kind"] == kind for reason in row["reasons"])]
            texts = [reason["text"] for row in first or having for reason in row["reasons"] if reason["kind"] == kind]
            indices = tuple(int(row["index"]) for row in first)
            found.append(Group(outcome, kind, indices, len(having) - len(first), texts[0]))
    order = (WRONG, NAMED, REFUSED)
    return sorted(found, key=lambda g: (order.index(g.outcome), -len(g.indices), -g.also))


def deciles(rows: Sequence[Row]) -> list[tuple[float, ...]]:
    """Least and most inductance of each tenth of the lives, and how many have each of `OUTCOMES`."""
    order = sorted(rows, key=lambda row: float(row["machine"]["inductance_pu"]))
    found = []
    for k in range(DECILES):
        part = order[k * len(order) // DECILES : (k + 1) * len(order) // DECILES]
        if part:
            low, high = (float(row["machine"]["inductance_pu"]) for row in (part[0], part[-1]))
            found.append((low, high, *(count(part, outcome) for outcome in OUTCOMES)))
    return found
