"""Register fuzzer: a program on the core writes and reads registers at random beside the control step of a drive.

Every copy of the drive gets a seed of its own. What must hold whatever is written: no leg with both gates on, no dead
time shorter than the locked one, and a core that goes on, that is a bus that has answered every access.
"""

from __future__ import annotations

import json
import random
import shutil
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from fluxlock.analysis.gates import gate_safety
from fluxlock.analysis.rundata import LogKind, RunData
from fluxlock.config import ConfigError, Problem, load_scenario
from fluxlock.config.specs import CLOCK_HZ
from fluxlock.cosim.launch import SimulatorError, run_plan
from fluxlock.cosim.plan import META_FILE, Action, Branch
from fluxlock.cosim.run import chip_of, collect, prepare
from fluxlock.firmware.toolchain import build_fuzz
from fluxlock.memory import FUZZ_ADDRESS, TELEMETRY_ADDRESS
from fluxlock.paths import BUILD, ROOT
from fluxlock.writable import alone

FOLDER = BUILD / "fuzz"
TICK_ADDRESS = TELEMETRY_ADDRESS + 12  # telemetry.h
COUNT_ADDRESS, WINDOWS_ADDRESS = FUZZ_ADDRESS + 4, FUZZ_ADDRESS + 12
WORD_BITS = 32
# Drives, and when their copies go astray, s.
DRIVES = {"six-step": 0.020, "vector": 0.030}
COPIES, SPAN_S = 10, 0.003
EDGE_S = 1e-9  # of the times of edges


@dataclass(frozen=True)
class FuzzRun:
    """What one seed did.

    gate_changes: after the seed was told. windows: a bit for each register block that was accessed. driven: share of
    the time with a gate on. alive: the core made accesses or control steps to the end.
    """

    seed: int
    accesses: int
    windows: int
    gate_changes: int
    driven: float
    shoot_throughs: int
    least_dead_time_s: float | None
    alive: bool

    @property
    def sparing(self) -> bool:
        """The registers that turn the gates off are only read."""
        return bool(self.seed & 1)

    def problems(self, dead_time_s: float) -> list[str]:
        """What must not have happened."""
        found = ["both gates of a leg on"] if self.shoot_throughs else []
        if self.least_dead_time_s is not None and self.least_dead_time_s < dead_time_s - EDGE_S:
            found.append(f"dead time {1e9 * self.least_dead_time_s:.0f} ns")
        return found + ([] if self.alive else ["the core stands still"])


def _told(seed: int, cycle: int) -> tuple[Action, ...]:
    """The seed into the mailbox, which holds 0."""
    bits = (bit for bit in range(WORD_BITS) if seed >> bit & 1)
    return tuple(Action(cycle, "memory", {"address": FUZZ_ADDRESS, "bit": bit}) for bit in bits)


def _seeds(seed: int, count: int) -> list[int]:
    """Seeds of the copies: every other one is odd, and not 0."""
    rng = random.Random(seed)
    return [rng.randrange(1, 1 << WORD_BITS - 1) << 1 | number & 1 for number in range(count)]


def _driven(changes: np.ndarray, since: int, span: int) -> float:
    """Share of a span, clocks, with a gate on. changes: rows of the log, of which the last before the span counts."""
    begins = np.clip(changes[:, 0], since, since + span)
    ends = np.append(begins[1:], since + span)
    return float((ends - begins)[changes[:, 2] != 0].sum() / span)


def _run_of(seed: int, data: RunData, meta: dict[str, Any], since: int, span: int) -> FuzzRun:
    """What one copy left."""
    safety = gate_safety(data)
    changes = data.rows(LogKind.GATES)
    (before, last) = meta["watched"][-2:]
    return FuzzRun(
        seed=seed,
        accesses=last[1],
        windows=last[2],
        gate_changes=int((changes[:, 0] > since).sum()),
        driven=_driven(changes, since, span),
        shoot_throughs=safety.shoot_throughs,
        least_dead_time_s=safety.least_dead_time_s,
        alive=meta["fault"] is None and before != last,
    )


def fuzz(drive: str, seed: int, count: int = COPIES, span_s: float = SPAN_S, jobs: int = 1) -> list[FuzzRun]:
    """`count` copies of a drive that go astray and are looked at for span_s."""
    scenario = load_scenario(scenario_of(drive))
    seeds = _seeds(seed, count)
    cycle, span = round(DRIVES[drive] * CLOCK_HZ), round(span_s * CLOCK_HZ)
    with alone(FOLDER / scenario.name, wait=True):
        folder = FOLDER / scenario.name / "runs"
        shutil.rmtree(folder, ignore_errors=True)
        branches = tuple(Branch(cycle, _told(s, cycle), span, span, folder / str(s)) for s in seeds)
        plan = prepare(scenario, folder / "simulator", seed, image=build_fuzz())
        plan = replace(plan, branches=branches, jobs=jobs, watch=(TICK_ADDRESS, COUNT_ADDRESS, WINDOWS_ADDRESS))
        meta = run_plan(plan, chip_of(scenario))
        if meta["fault"]:
            raise SimulatorError(f"the run before the writes broke off: {meta['fault']}")
        runs = []
        for own, branch in zip(seeds, branches, strict=True):
            meta = json.loads((branch.folder / META_FILE).read_text())
            data = collect(replace(plan, folder=branch.folder), meta, scenario.motor.pole_pairs)
            runs.append(_run_of(own, data, meta, cycle, span))
    return runs


def scenario_of(drive: str) -> Path:
    """Scenario file of a drive."""
    return ROOT / "scenarios" / "campaign" / f"{drive}.toml"


def fuzz_drives(names: Sequence[str], seed: int, count: int, span_s: float, jobs: int) -> bool:
    """The named drives, or all; a line for each and for each run that ended wrong; False if one did."""
    if missing := [name for name in names if name not in DRIVES]:
        raise ConfigError([Problem("fuzz", name, f"no drive; drives: {', '.join(DRIVES)}") for name in missing])
    right = True
    for drive in names or DRIVES:
        runs = fuzz(drive, seed, count, span_s, jobs)
        accesses, driven = sum(run.accesses for run in runs), sum(run.driven for run in runs) / len(runs)
        print(f"{drive}, seed {seed}: {len(runs)} runs, {accesses} accesses, a gate on for {driven:.0%} of the time")
        for run in runs:
            for problem in run.problems(load_scenario(scenario_of(drive)).inverter.dead_time_s):
                right = False
                print(f"wrong: {drive}, seed {seed}, run {run.seed}: {problem}", file=sys.stderr)
    return right
