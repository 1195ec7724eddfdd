# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Build the netlist of a block with its test bench and run the tests on every mutant."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

from fluxlock.base.paths import ROOT, RTL
from fluxlock.cosim.block import run_block_test
from fluxverify.mutation.blocks import Block
from fluxverify.mutation.netlist import SELECTOR, Netlist, folder
from fluxverify.mutation.simulation import JOB_VARIABLE, read_outcomes

POLL_S = 0.5


class MutationError(RuntimeError):
    """The tests cannot be run on the block's netlist."""


def _watch(path: Path, progress: Callable[[int], None], done: threading.Event) -> None:
    while not done.wait(POLL_S):
        progress(max(0, len(read_outcomes(path)) - 1))


def run_mutants(
    block: Block, netlist: Netlist, numbers: list[int], seed: int, jobs: int, progress: Callable[[int], None]
) -> dict[int, dict[str, Any]]:
    """Outcome of each of the mutants `numbers`, and of the block as it is (0), which must pass.

    Outcomes of a run before with the same inputs are kept. progress: called now and then with the number of mutants
    that are through.
    """
    work = folder(block)
    out, job = work / "outcomes.jsonl", work / "job.json"
    bench = [ROOT / name if name.startswith("cocotb_tests/") else name for name in block.bench_sources]
    environment = {**block.environment, "COCOTB_RANDOM_SEED": str(seed)}
    job.write_text(
        json.dumps(
            {
                "selector": [*([block.instance] if block.instance else []), SELECTOR],
                "modules": block.test_modules,
                "left_out": block.left_out,
                "mutants": numbers,
                "folder": str(work),
                "out": str(out),
                "jobs": jobs,
                "sources": [str(RTL / name) for name in (netlist.verilog, *bench)],
                "environment": environment,
            }
        )
    )
    done = threading.Event()
    watcher = threading.Thread(target=_watch, args=(out, progress, done), daemon=True)
    watcher.start()
    try:
        run_block_test(
            block.bench or block.name,
            [netlist.verilog, *bench],
            "fluxverify.mutation.simulation",
            extra_env={
                **block.environment,
                JOB_VARIABLE: str(job),
                "COCOTB_MAX_FAILURES": "1",
                "COCOTB_REWRITE_ASSERTION_FILES": "",
            },
            seed=seed,
            log=work / "simulation.log",
            seen=["*"],
        )
    finally:
        done.set()
        watcher.join()
    outcomes = read_outcomes(out)
    if outcomes[0]["killed_by"]:
        raise MutationError(
            f"{block.name}: the netlist without a mutation fails {outcomes[0]['killed_by']}: {work / 'baseline.log'}"
        )
    return outcomes
