# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Build the netlist of a block with its test bench and run the tests on every mutant."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from typing import Any

from fluxlock.base.paths import ROOT, RTL
from fluxlock.cosim.block import run_block_test
from fluxlock.workers import shares, side_by_side
from fluxverify.mutation.blocks import NONE, Block
from fluxverify.mutation.netlist import SELECTOR, Netlist, folder
from fluxverify.mutation.simulation import JOB_VARIABLE, has_ended, read_outcomes

OUTCOMES = "outcomes.jsonl"
SHARE_MUTANTS = 50  # of a simulator: its start is little beside them


class MutationError(RuntimeError):
    """The tests cannot be run on the block's netlist."""


def run_share(block: Block, sources: list[str], seed: int, mutants: tuple[int, ...]) -> None:
    """Run the tests on mutants, or on the block as it is (0), in one simulator that is copied for each."""
    work = folder(block)
    path = work / f"job-{mutants[0]}.json"
    job = {
        "selector": [*([block.instance] if block.instance else []), SELECTOR],
        "modules": block.test_modules,
        "left_out": block.left_out,
        "mutants": mutants,
        "folder": str(work),
        "out": str(work / OUTCOMES),
        "sources": sources,
        "environment": {**block.environment, "COCOTB_RANDOM_SEED": str(seed)},
    }
    path.write_text(json.dumps(job))
    run_block_test(
        block.bench or block.name,
        sources,
        "fluxverify.mutation.simulation",
        extra_env={
            **block.environment,
            JOB_VARIABLE: str(path),
            "COCOTB_MAX_FAILURES": "1",
            "COCOTB_REWRITE_ASSERTION_FILES": "",
        },
        seed=seed,
        log=work / f"simulation-{mutants[0]}.log",
        seen=["*"],
    )


def run_mutants(
    block: Block, netlist: Netlist, numbers: list[int], seed: int, jobs: int, progress: Callable[[int], None]
) -> dict[int, dict[str, Any]]:
    """Outcome of each of the mutants `numbers`, and of the block as it is (0), which must pass.

    Outcomes of a run before with the same inputs are kept. progress: called now and then with the number of mutants
    that are through.
    """
    bench = [ROOT / name if name.startswith("cocotb_tests/") else name for name in block.bench_sources]
    sources, out = [str(RTL / name) for name in (netlist.verilog, *bench)], folder(block) / OUTCOMES
    run_share(block, sources, seed, (NONE,))  # builds the simulator, and says what is known already
    outcomes = read_outcomes(out)
    if killed_by := outcomes[NONE]["killed_by"]:
        log = folder(block) / "baseline.log"
        raise MutationError(f"{block.name}: the netlist without a mutation fails {killed_by}: {log}")
    left = [n for n in numbers if not has_ended(outcomes.get(n), outcomes[NONE])]

    def look() -> None:
        known = read_outcomes(out)
        progress(sum(has_ended(known.get(n), known[NONE]) for n in numbers))

    items = shares(left, min(SHARE_MUTANTS, max(1, -(-len(left) // jobs))))
    side_by_side(partial(run_share, block, sources, seed), items, jobs, lambda *_: None, look, shares_build=True)
    return read_outcomes(out)
