"""Mutation score for the docs: `python -m fluxlock.docs.mutation` after `make mutation`.

Why a survivor is none that a test ought to find stands in `docs/verification/survivors.toml`: a table a block, entries
with `source` (beginning of file:line.column), `reason`, if need be `wire` and `port` (name, with or without the bit)
and `kind`. A reason that fits no survivor is an error, so that none stays behind when a test or the RTL changes.
"""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path
from typing import Any

from fluxlock.mutation.score import RESULTS, read_results
from fluxlock.paths import ROOT

PAGE = ROOT / "docs" / "verification" / "mutation.md"
REASONS = ROOT / "docs" / "verification" / "survivors.toml"

HEAD = """# Mutation score

Written by `python -m fluxlock.docs.mutation` from `build/mutate`, which `make mutation` fills
(`make mutation BLOCKS=fl_trip` for one block).

A mutant is the block with one defect: one bit of one port of a cell of its netlist is inverted, stuck at 0 or 1, or
inverted while another bit of that port is 0 or 1. Yosys spreads the mutants evenly over source lines, nets and cells;
all of them are in one simulation, a selector picks one. The block's own tests run on each until the first fails.
Assertions beside the logic are taken out: only the tests count. Survivors that SAT proves to be the block itself,
register by register, are *equal*. Score = killed / (mutants - equal).
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


def page(results: list[dict[str, Any]], reasons: dict[str, list[dict[str, str]]]) -> tuple[str, list[str]]:
    """The page, and a line for each reason of a measured block that fits no survivor."""
    lines = [HEAD, "| block | mutants | killed | equal | survived | score / % | goal / % | CPU / s |", "|" + "---|" * 8]
    for r in results:
        counts = " | ".join(str(r[key]) for key in ("count", "killed", "equal", "survived"))
        lines.append(
            f"| {r['block']} | {counts} | {r['score_percent']:.1f} | {r['goal_percent']:.0f} | {r['cpu_s']:.0f} |"
        )
    stale = []
    for r in results:
        given = reasons.get(r["block"], [])
        survivors = [row for row in r["mutants"] if row["result"] == "survived"]
        lines += ["", f"## {r['block']}", "", f"Seed {r['seed']}, {r['yosys'].partition(' (')[0]}."]
        if survivors:
            lines += ["", "| survivor | port | net | defect | why |", "|---|---|---|---|---|"]
        for row in survivors:
            found = reason_of(row, given)
            why = found["reason"] if found else "not explained"
            place = row["source"].rpartition("/")[2]
            lines.append(f"| {place} | {row['port']} | {row['wire'] or '-'} | {row['kind']} | {why} |")
        used = [reason_of(row, given) for row in survivors]
        stale += [f"{r['block']}: no survivor for the reason at {e['source']}" for e in given if e not in used]
    return "\n".join(lines) + "\n", stale


def main(path: Path = PAGE) -> int:
    """Write the page; exit code 1 without results or with a reason that fits nothing."""
    results = read_results()
    if not results:
        print(f"error: {RESULTS} holds no results; run make mutation", file=sys.stderr)
        return 1
    reasons = tomllib.loads(REASONS.read_text(encoding="utf-8"))
    text, stale = page(results, reasons)
    path.write_text(text, encoding="utf-8")
    print(f"written: {path}")
    for line in stale:
        print(f"error: {REASONS}: {line}", file=sys.stderr)
    return 1 if stale else 0


if __name__ == "__main__":
    sys.exit(main())
