# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Mutation score for the docs: `python -m fluxverify.docs.mutation` after `make mutation`.

Of a block without a result in `build/mutate` the page keeps what it says, so that one block can be measured alone.
Why a survivor is none that a test ought to find stands in `docs/verification/survivors.toml`: a table a block, entries
with `source` (beginning of file:line.column), `reason`, if need be `wire` and `port` (name, with or without the bit)
and `kind`. A reason that fits no survivor is an error, so that none stays behind when a test or the RTL changes.
"""

from __future__ import annotations

import re
import sys
import tomllib
from pathlib import Path
from typing import Any

from fluxlock.base.paths import ROOT
from fluxlock.sources import sources_text
from fluxverify.mutation.blocks import BLOCKS
from fluxverify.mutation.score import RESULTS, read_results

PAGE = ROOT / "docs" / "verification" / "mutation.md"
REASONS = ROOT / "docs" / "verification" / "survivors.toml"

HEAD = """# Mutation score

Written by `python -m fluxverify.docs.mutation` from `build/mutate`, which `make mutation` fills
(`make mutation BLOCKS=fl_trip` for one block).

A mutant is the block with one defect: one bit of one port of a cell of its netlist is inverted, stuck at 0 or 1, or
inverted while another bit of that port is 0 or 1. Yosys spreads the mutants evenly over source lines, nets and cells;
all of them are in one simulation, a selector picks one. The block's own tests run on each until the first fails, their
processor time is in the table. Assertions beside the logic are taken out: only the tests count. Score = killed /
(mutants - equal).

Survivors that SAT proves to be the block itself are *equal*: register by register (Yosys `equiv_induct`), or at the
outputs alone. For that block and mutant run side by side with the same inputs, first a reset, or the input that a block
has in its place for as long as that takes to act. Each register begins with any value, the same in both. That their
outputs agree for ever is proved by induction over up to four clocks (`sat -tempinduct`), if need be together with the
claim that registers agree, always or as long as a flag of the block is 0 (or 1). What is not decided within two minutes
of processor time has survived. A block with registers that an input clears without a clock is held to one step from any
state, and a defect of its clear is not tried.
"""


def _names(name: str, wanted: str) -> bool:
    """True for no wish, the name itself, and a bit of it."""
    return not wanted or name == wanted or name.startswith(f"{wanted}[")


def reason_of(row: dict[str, Any], reasons: list[dict[str, str]]) -> dict[str, str] | None:
    """First reason that fits a survivor."""
    for reason in reasons:
        named = all(_names(row[key], reason.get(key, "")) for key in ("wire", "port", "kind"))
        if named and row["source"].startswith(reason["source"]):
            return reason
    return None


def _kept(text: str, name: str) -> tuple[str, str]:
    """Row and section of a block on a page; empty if it is not on it."""
    row = re.search(rf"^\| {name} \|.*$", text, re.MULTILINE)
    section = re.search(rf"^## {name}\n.*?(?=\n## |\Z)", text, re.MULTILINE | re.DOTALL)
    return (row[0], section[0].rstrip()) if row and section else ("", "")


def _written(result: dict[str, Any], reasons: list[dict[str, str]]) -> tuple[str, str, list[str]]:
    """Row and section of a result, and a line for each reason that fits no survivor."""
    name = result["block"]
    counts = " | ".join(str(result[key]) for key in ("count", "killed", "equal", "survived"))
    score = f"{result['score_percent']:.1f} | {result['goal_percent']:.0f} | {result['cpu_s']:.0f}"
    survivors = [row for row in result["mutants"] if row["result"] == "survived"]
    conditions = [f"Seed {result['seed']}", result["yosys"].partition(" (")[0]]
    conditions += [f"`{key}` = {value}" for key, value in result["parameters"].items()]
    conditions += [sources_text(result.get("sources"))]
    lines = [f"## {name}", "", f"{', '.join(conditions)}."]
    if survivors:
        lines += ["", "| survivor | port | net | defect | why |", "|---|---|---|---|---|"]
    for row in survivors:
        found = reason_of(row, reasons)
        why = found["reason"] if found else "not explained"
        place = row["source"].rpartition("/")[2]
        lines.append(f"| {place} | {row['port']} | {row['wire'] or '-'} | {row['kind']} | {why} |")
    used = [reason_of(row, reasons) for row in survivors]
    stale = [f"{name}: no survivor for the reason at {entry['source']}" for entry in reasons if entry not in used]
    return f"| {name} | {counts} | {score} |", "\n".join(lines), stale


def page(
    results: list[dict[str, Any]], reasons: dict[str, list[dict[str, str]]], before: str = ""
) -> tuple[str, list[str]]:
    """The page, and a line for each reason of a measured block that fits no survivor.

    before: the page as it is; blocks without a result are taken over from it.
    """
    measured = {result["block"]: result for result in results}
    rows, sections, stale = [], [], []
    for name in [*BLOCKS, *(name for name in measured if name not in BLOCKS)]:
        if name in measured:
            row, section, unused = _written(measured[name], reasons.get(name, []))
            stale += unused
        else:
            row, section = _kept(before, name)
        rows += [row] if row else []
        sections += [section] if section else []
    table = [
        "| block | mutants | killed | equal | survived | score / % | goal / % | CPU / s |",
        "|" + "---|" * 8,
        *rows,
    ]
    return "\n\n".join([HEAD.rstrip(), "\n".join(table), *sections]) + "\n", stale


def main(path: Path = PAGE) -> int:
    """Write the page; exit code 1 without results or with a reason that fits nothing."""
    results = read_results()
    if not results:
        print(f"error: {RESULTS} holds no results; run make mutation", file=sys.stderr)
        return 1
    reasons = tomllib.loads(REASONS.read_text(encoding="utf-8"))
    before = path.read_text(encoding="utf-8") if path.exists() else ""
    text, stale = page(results, reasons, before)
    path.write_text(text, encoding="utf-8")
    print(f"written: {path}")
    for line in stale:
        print(f"error: {REASONS}: {line}", file=sys.stderr)
    return 1 if stale else 0


if __name__ == "__main__":
    sys.exit(main())
