"""Register fuzzer: a program on the core writes and reads registers at random beside the control step of a drive.

Every copy of the drive gets a seed of its own. What must hold whatever is written: no leg with both gates on, no dead
time shorter than the locked one, and a core that goes on, that is a bus that has answered every access.
"""

from __future__ import annotations

import json
import random
import shutil
from dataclasses import dataclass, replace

from fluxlock.analysis.gates import gate_safety
from fluxlock.analysis.rundata import LogKind
from fluxlock.config import load_scenario
from fluxlock.config.specs import CLOCK_HZ
from fluxlock.cosim.launch import run_plan
from fluxlock.cosim.plan import META_FILE, Action, Branch
from fluxlock.cosim.run import chip_of, collect, prepare
from fluxlock.firmware.toolchain import build_fuzz
from fluxlock.memory import FUZZ_ADDRESS, TELEMETRY_ADDRESS
from fluxlock.paths import BUILD, ROOT

FOLDER = BUILD / "fuzz"
TICK_ADDRESS = TELEMETRY_ADDRESS + 12  # telemetry.h
COUNT_ADDRESS = FUZZ_ADDRESS + 4
WORD_BITS = 32


@dataclass(frozen=True)
class FuzzRun:
    """What one seed did.

    gate_changes: after the seed was told. alive: the core made accesses or control steps to the end.
    """

    seed: int
    accesses: int
    gate_changes: int
    shoot_throughs: int
    least_dead_time_s: float | None
    alive: bool


def _told(seed: int, cycle: int) -> tuple[Action, ...]:
    """The seed into the mailbox, which holds 0."""
    bits = (bit for bit in range(WORD_BITS) if seed >> bit & 1)
    return tuple(Action(cycle, "memory", {"address": FUZZ_ADDRESS, "bit": bit}) for bit in bits)


def fuzz(scenario_file: str, at_s: float, seed: int, count: int, span_s: float, jobs: int = 1) -> list[FuzzRun]:
    """`count` copies of a scenario that go astray at an instant and are looked at for span_s."""
    scenario = load_scenario(ROOT / "scenarios" / scenario_file)
    rng = random.Random(seed)
    seeds = [rng.randrange(1, 1 << WORD_BITS) for _ in range(count)]
    folder = FOLDER / scenario.name
    shutil.rmtree(folder, ignore_errors=True)
    cycle, span = round(at_s * CLOCK_HZ), round(span_s * CLOCK_HZ)
    branches = tuple(Branch(cycle, _told(s, cycle), span, span, folder / str(s)) for s in seeds)
    plan = prepare(scenario, folder / "simulator", seed, image=build_fuzz())
    plan = replace(plan, branches=branches, jobs=jobs, watch=(TICK_ADDRESS, COUNT_ADDRESS))
    meta = run_plan(plan, chip_of(scenario))
    if meta["fault"]:
        raise RuntimeError(f"the run before the writes broke off: {meta['fault']}")
    runs = []
    for own, branch in zip(seeds, branches, strict=True):
        meta = json.loads((branch.folder / META_FILE).read_text())
        data = collect(replace(plan, folder=branch.folder), meta, scenario.motor.pole_pairs)
        safety = gate_safety(data)
        changes = data.rows(LogKind.GATES)
        (before, last) = meta["watched"][-2:]
        runs.append(
            FuzzRun(
                own,
                last[1],
                int((changes[:, 0] > cycle).sum()),
                safety.shoot_throughs,
                safety.least_dead_time_s,
                meta["fault"] is None and before != last,
            )
        )
    return runs
