# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Register fuzzer: a program on the core writes and reads registers at random beside the control step of a drive.

Every copy of the drive gets a seed of its own. What must hold whatever is written: no leg with both gates on, no dead
time shorter than the locked one, no phase current above the trip's limit for long with a gate on, and a core that goes
on, that is a bus that has answered every access. Where the writes turn the gates off the program brings the drive back.
"""

from __future__ import annotations

import json
import random
import shutil
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from fluxlock.base.paths import BUILD, ROOT
from fluxlock.base.writable import alone
from fluxlock.clock import CLOCK_HZ
from fluxlock.config import ConfigError, Problem, Scenario, load_scenario
from fluxlock.cosim.chip import build_chip
from fluxlock.cosim.launch import LOG_FILE, SimulatorError, run_plan
from fluxlock.cosim.plan import META_FILE, Action, Branch
from fluxlock.cosim.run import collect, prepare
from fluxlock.firmware.toolchain import build_fuzz
from fluxlock.generate.memory import FUZZ_ADDRESS
from fluxlock.results.gates import gate_safety
from fluxlock.results.rundata import LogKind, RunData
from fluxlock.workers import shares, side_by_side
from fluxverify.campaign.judge import CURRENT_S, PULSE_S, over_current_s

FOLDER = BUILD / "fuzz"
COUNT_ADDRESS, WINDOWS_ADDRESS = FUZZ_ADDRESS + 4, FUZZ_ADDRESS + 8
WORD_BITS = 32
COPIES, SPAN_S = 10, 0.010
EDGE_S = 1e-9  # of the times of edges
# Looks at the counters, half a millisecond apart, of which one must show another access: interrupts without end hold
# the program up until it ends them.
PATIENCE_LOOKS = 5


@dataclass(frozen=True)
class Drive:
    """What goes astray: a scenario of `scenarios/campaign`, when, s, and whether its chip has the CAN controller.

    The chip has the paths of both methods. The fuzzer's program has no CANopen node.
    """

    scenario: str
    at_s: float
    can: bool = False
    overrides: tuple[str, ...] = ()

    def load(self) -> Scenario:
        """The scenario."""
        return load_scenario(ROOT / "scenarios" / "campaign" / f"{self.scenario}.toml", self.overrides)


DRIVES = {
    # With a dead time in every carrier.
    "six-step": Drive("six-step", 0.020, can=True, overrides=("drive.sync_rect=true",)),
    "vector": Drive("vector", 0.030, can=True),
    "five-phase": Drive("fuzz-five-phase", 0.060),
}


@dataclass(frozen=True)
class FuzzRun:
    """What one seed did.

    gate_changes: after the seed was told. rearms: how often a gate went on after all had been off for longer than
    between two pulses. windows: a bit for each register block that was accessed. driven: share of the time with a gate
    on. over_current_s: longest time with a phase current above the trip's limit and a gate on. alive: the core made
    accesses to the end. broke_off: why the simulation did, "" if it did not; by an assertion it leaves nothing else.
    """

    seed: int
    accesses: int = 0
    windows: int = 0
    gate_changes: int = 0
    rearms: int = 0
    driven: float = 0.0
    shoot_throughs: int = 0
    least_dead_time_s: float | None = None
    over_current_s: float = 0.0
    alive: bool = True
    broke_off: str = ""

    def problems(self, dead_time_s: float) -> list[str]:
        """What must not have happened."""
        found = [f"simulation broke off: {self.broke_off}"] if self.broke_off else []
        found += ["both gates of a leg on"] if self.shoot_throughs else []
        if self.least_dead_time_s is not None and self.least_dead_time_s < dead_time_s - EDGE_S:
            found.append(f"dead time {1e9 * self.least_dead_time_s:.0f} ns")
        if self.over_current_s > CURRENT_S:
            found.append(f"current above the limit for {1e6 * self.over_current_s:.0f} us")
        return found + ([] if self.alive else ["the core stands still"])


def _told(seed: int, cycle: int) -> tuple[Action, ...]:
    """The seed into the mailbox, which holds 0."""
    bits = (bit for bit in range(WORD_BITS) if seed >> bit & 1)
    return tuple(Action(cycle, "memory", {"address": FUZZ_ADDRESS, "bit": bit}) for bit in bits)


def _seeds(seed: int, count: int) -> list[int]:
    """Seeds of the copies, not 0."""
    rng = random.Random(seed)
    return [rng.randrange(1, 1 << WORD_BITS) for _ in range(count)]


def _gated(changes: np.ndarray, since: int, span: int) -> tuple[float, int]:
    """Share of a span, clocks, with a gate on, and how often one went on again.

    changes: rows of the log, of which the last before the span counts.
    """
    begins = np.clip(changes[:, 0], since, since + span)
    ends = np.append(begins[1:], since + span)
    on = changes[:, 2] != 0
    again = ~on[:-1] & on[1:] & ((ends - begins)[:-1] > PULSE_S * CLOCK_HZ) & (ends[:-1] < since + span)
    return float((ends - begins)[on].sum() / span), int(again.sum())


def _alive(counts: Sequence[int]) -> bool:
    """Whether the accesses, counted at every look, went on to the end."""
    counts = [0, *counts]
    later = counts[min(PATIENCE_LOOKS, len(counts) - 1) :]
    return all(after > before for before, after in zip(counts, later, strict=False))


def _run_of(seed: int, data: RunData, meta: dict[str, Any], limit_a: float, since: int, span: int) -> FuzzRun:
    """What one copy left."""
    safety = gate_safety(data)
    changes = data.rows(LogKind.GATES)
    driven, rearms = _gated(changes, since, span)
    counts = [count for count, _ in meta["watched"]]
    return FuzzRun(
        seed=seed,
        accesses=counts[-1],
        windows=meta["watched"][-1][1],
        gate_changes=int((changes[:, 0] > since).sum()),
        rearms=rearms,
        driven=driven,
        shoot_throughs=safety.shoot_throughs,
        least_dead_time_s=safety.least_dead_time_s,
        over_current_s=over_current_s(data.records[data.records["t_cycle"] >= since], data.clock_hz, limit_a),
        alive=_alive(counts),
        broke_off=meta["fault"] or "",
    )


def fuzz(name: str, seed: int, count: int = COPIES, span_s: float = SPAN_S, jobs: int = 1) -> list[FuzzRun]:
    """`count` copies of a drive that go astray and are looked at for span_s."""
    seeds, found = _seeds(seed, count), dict[int, FuzzRun]()
    with alone(FOLDER / name, wait=True):
        shutil.rmtree(FOLDER / name / "runs", ignore_errors=True)

        def store(_: tuple[int, ...], runs: list[FuzzRun]) -> None:
            found.update((run.seed, run) for run in runs)

        items = shares(seeds, -(-count // jobs))
        side_by_side(partial(fuzz_share, name, seed, span_s), items, jobs, store, shares_build=True)
    return [found[own] for own in seeds]


def fuzz_share(name: str, seed: int, span_s: float, seeds: tuple[int, ...]) -> list[FuzzRun]:
    """Copies of one simulator, one for each of the seeds. seed: of the drive itself."""
    drive = DRIVES[name]
    scenario, folder = drive.load(), FOLDER / name / "runs"
    cycle, span = round(drive.at_s * CLOCK_HZ), round(span_s * CLOCK_HZ)
    branches = tuple(Branch(cycle, _told(s, cycle), span, span, folder / str(s)) for s in seeds)
    phases, injects = scenario.motor.phases, scenario.drive.vector.injection is not None
    program = build_fuzz(phases, scenario.drive.method)
    plan = prepare(scenario, folder / f"simulator-{seeds[0]}", seed, image=program)
    plan = replace(plan, branches=branches, watch=(COUNT_ADDRESS, WINDOWS_ADDRESS), final_commands=())
    meta = run_plan(plan, build_chip(phases=phases, injection=injects, can=drive.can))
    if meta["fault"]:
        raise SimulatorError(f"the run before the writes broke off: {meta['fault']}")
    limit_a = scenario.inverter.protection.phase_current_a
    runs = []
    for own, branch in zip(seeds, branches, strict=True):
        path = branch.folder / META_FILE
        if not path.exists():
            runs.append(FuzzRun(own, broke_off=f"see {plan.folder / LOG_FILE}"))
            continue
        meta = json.loads(path.read_text())
        data = collect(replace(plan, folder=branch.folder), meta, scenario.motor.pole_pairs)
        runs.append(_run_of(own, data, meta, limit_a, cycle, span))
    return runs


def fuzz_drives(names: Sequence[str], seed: int, count: int, span_s: float, jobs: int) -> bool:
    """The named drives, or all; a line for each and for all that was wrong; False if anything was."""
    if missing := [name for name in names if name not in DRIVES]:
        raise ConfigError([Problem("fuzz", name, f"no drive; drives: {', '.join(DRIVES)}") for name in missing])
    right = True
    for name in names or DRIVES:
        runs = fuzz(name, seed, count, span_s, jobs)
        accesses, rearms = sum(run.accesses for run in runs), sum(run.rearms for run in runs)
        gated = f"a gate on for {sum(run.driven for run in runs) / len(runs):.0%} of the time, on again {rearms} times"
        print(f"{name}, seed {seed}: {len(runs)} runs, {accesses} accesses, {gated}")
        dead_time_s = DRIVES[name].load().inverter.dead_time_s
        for run in runs:
            for problem in run.problems(dead_time_s):
                right = False
                print(f"wrong: {name}, seed {seed}, run {run.seed}: {problem}", file=sys.stderr)
    return right
