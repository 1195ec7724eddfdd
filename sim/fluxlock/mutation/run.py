"""Build the netlist of a block with its test bench and run the tests on every mutant."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

from fluxlock.cosim.block import run_block_test
from fluxlock.mutation.blocks import Block
from fluxlock.mutation.netlist import SELECTOR, Netlist, folder
from fluxlock.mutation.simulation import JOB_VARIABLE
from fluxlock.paths import ROOT

POLL_S = 0.5


class MutationError(RuntimeError):
    """The tests cannot be run on the block's netlist."""


def read_outcomes(path: Path) -> dict[int, dict[str, Any]]:
    """Outcome by mutant so far; a line still being written is left for the next look."""
    lines = path.read_text().splitlines(keepends=True) if path.exists() else []
    found = [json.loads(line) for line in lines if line.endswith("\n")]
    return {entry.pop("mutant"): entry for entry in found}


def _watch(path: Path, progress: Callable[[int], None], done: threading.Event) -> None:
    while not done.wait(POLL_S):
        progress(max(0, len(read_outcomes(path)) - 1))


def run_mutants(
    block: Block, netlist: Netlist, numbers: list[int], seed: int, jobs: int, progress: Callable[[int], None]
) -> dict[int, dict[str, Any]]:
    """Outcome of each of the mutants `numbers`, and of the block as it is (0), which must pass.

    progress: called now and then with the number of mutants that are through.
    """
    work = folder(block)
    out, job = work / "outcomes.jsonl", work / "job.json"
    out.unlink(missing_ok=True)
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
            }
        )
    )
    bench = [ROOT / name if name.startswith("cocotb_tests/") else name for name in block.bench_sources]
    done = threading.Event()
    watcher = threading.Thread(target=_watch, args=(out, progress, done), daemon=True)
    watcher.start()
    try:
        run_block_test(
            block.bench or block.name,
            [netlist.verilog, *bench],
            "fluxlock.mutation.simulation",
            extra_env={
                **block.environment,
                JOB_VARIABLE: str(job),
                "COCOTB_MAX_FAILURES": "1",
                "COCOTB_REWRITE_ASSERTION_FILES": "",
            },
            seed=seed,
            log=work / "simulation.log",
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
