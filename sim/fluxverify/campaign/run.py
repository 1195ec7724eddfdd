# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Run a campaign: a copy of a simulator for each run; every run judged, its trace kept if it ended wrong."""

from __future__ import annotations

import contextlib
import json
import random
import re
import shutil
from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from fluxlock.base.paths import BUILD, PACKAGE, content_hash
from fluxlock.base.writable import InUseError, alone
from fluxlock.clock import CLOCK_HZ
from fluxlock.config import ConfigError, Problem, Scenario
from fluxlock.cosim.chip import BOARD_CODE_CYCLES, Chip, build_chip
from fluxlock.cosim.launch import SimulatorError, run_plan
from fluxlock.cosim.plan import META_FILE, RAW_FILE, Branch, SessionPlan
from fluxlock.cosim.run import IMAGE_FILE, chip_of, collect, image_of, prepare
from fluxlock.cosim.upsets import read_upset_table
from fluxlock.workers import shares, side_by_side
from fluxverify.campaign.board import board_faults
from fluxverify.campaign.faults import plant_faults
from fluxverify.campaign.grid import Drive, Fault, Moment
from fluxverify.campaign.judge import WRONG, judge
from fluxverify.campaign.master import master_of, told_since
from fluxverify.campaign.upsets import SAMPLE_PERIOD, actions_of, parameter_upsets, upsets

FOLDER = BUILD / "campaign"
ROW_FILE = "row.json"
SETTLE_S = 2e-3  # in the fault state
# Upsets a moment: registers, words of memory, locked settings.
FULL_UPSETS, QUICK_UPSETS = (20, 8, 3), (3, 1, 1)
# Upsets of the parameters, of which the block has more bytes.
FULL_PARAMETERS, QUICK_PARAMETERS, PARAMETER_BYTES = 20, 2, 960
SHARE_RUNS = 50  # of a simulator: what it needs to reach their moment is little beside them

Done = Callable[[int, int], None]  # runs that have ended, of all


@dataclass(frozen=True)
class Run:
    """One cell of the grid."""

    drive: str
    moment: Moment
    fault: Fault
    folder: Path

    @property
    def unchecked(self) -> bool:
        """Whether it runs without the RTL's assertions."""
        return self.fault.upset or self.fault.unchecked


def grid(drive: Drive, seed: int, quick: bool, every: int = 1) -> list[Run]:
    """The runs of a drive. quick: its last moment, a sixth of the faults; every: one run of so many."""
    runs = []
    known = board_faults() if drive.board else plant_faults(drive)
    for moment in drive.moments[-1:] if quick else drive.moments:
        rng = random.Random(f"{seed} {drive.name} {moment.name}")
        if moment.boot:
            faults = parameter_upsets(rng, QUICK_PARAMETERS if quick else FULL_PARAMETERS, PARAMETER_BYTES)
        else:
            chosen = rng.sample(range(len(known)), len(known) // (6 if quick else 1))
            faults = [known[n] for n in sorted(chosen)]
            if moment.names:
                faults = [replace(fault, names=fault.names | moment.names) for fault in faults]
            if not drive.board:
                faults += [SAMPLE_PERIOD, *upsets(rng, *(QUICK_UPSETS if quick else FULL_UPSETS))]
        for fault in faults:
            if not moment.takes(fault):
                continue
            name = re.sub(r"[,:'\[\]]", "", fault.name).replace(" ", "-").replace("%", "pc")
            runs.append(Run(drive.name, moment, fault, FOLDER / drive.name / moment.name / name))
    return runs[::every]


def population(chip: Chip) -> dict[str, int]:
    """Registers that upsets are drawn from, with their bits, in the order of the chip's table."""
    return read_upset_table(chip.executable.parent)


def _branch(run: Run, registers: list[str], image: Path) -> Branch:
    cycle = round(run.moment.at_s * CLOCK_HZ)
    actions = actions_of(run.fault, cycle, registers, image)
    return Branch(cycle, actions, round(run.fault.span_s * CLOCK_HZ), round(SETTLE_S * CLOCK_HZ), run.folder)


def _row(run: Run, scenario: Scenario, plan: SessionPlan) -> dict[str, Any]:
    """Verdict of a run that has left its folder; the trace of a right end is deleted."""
    row: dict[str, Any] = {"drive": run.drive, "moment": run.moment.name, "at_s": run.moment.at_s}
    row |= {"disturbance": run.fault.name, "seed": plan.seed}
    path = run.folder / META_FILE
    if not path.exists():
        return {**row, "outcome": WRONG, "reasons": ["the simulator ended without a result"], "upsets": []}
    meta = json.loads(path.read_text())
    row["upsets"] = meta["upsets"]
    if meta["fault"]:
        return {**row, "outcome": WRONG, "reasons": [f"simulation broke off: {meta['fault']}"]}
    data = collect(replace(plan, folder=run.folder), meta, scenario.motor.pole_pairs)
    since = round(run.moment.at_s * CLOCK_HZ)
    verdict = judge(data, scenario, run.fault, since, told_since(meta["conclusion"], since))
    if verdict.outcome != WRONG:
        (run.folder / RAW_FILE).unlink()
    return {**row, **asdict(verdict), "reasons": list(verdict.reasons)}


@dataclass
class Book:
    """The verdicts of a drive's runs, each in a file beside what the run left: what is finished is not run again."""

    drive: Drive
    scenario: Scenario
    plan: SessionPlan
    equal: str  # hash of what makes all runs

    def _key(self, run: Run) -> str:
        fault = run.fault
        told = (fault.name, fault.changes, sorted(fault.names), fault.must_stop, fault.span_s, fault.unchecked)
        return content_hash([], self.equal, run.moment, *told, fault.off_s, fault.silent)

    def find(self, run: Run) -> dict[str, Any] | None:
        """Verdict of a finished run."""
        path = run.folder / ROW_FILE
        if not path.exists():
            return None
        kept = json.loads(path.read_text())
        found: dict[str, Any] | None = kept["row"] if kept["key"] == self._key(run) else None
        return found

    def enter(self, run: Run) -> dict[str, Any]:
        """Judge a run that has ended."""
        row = _row(run, self.scenario, self.plan)
        meta = run.folder / META_FILE
        cpu_s = json.loads(meta.read_text())["cpu_s"] if meta.exists() else 0.0
        text = json.dumps({"key": self._key(run), "row": row, "cpu_s": cpu_s})
        run.folder.mkdir(parents=True, exist_ok=True)
        (run.folder / ROW_FILE).write_text(text, encoding="utf-8")
        return row


def mean_cpu_s(runs: Iterable[Run]) -> float:
    """Processor time of a finished run from its moment on, mean."""
    paths = [run.folder / ROW_FILE for run in runs]
    spent = [float(json.loads(path.read_text()).get("cpu_s", 0.0)) for path in paths if path.exists()]
    return sum(spent) / max(1, len(spent))


def chip_for(drive: Drive) -> Chip:
    """The simulated chip of a drive."""
    return build_chip(board=True) if drive.board else chip_of(drive.load(), can=drive.can)


def open_book(drive: Drive, seed: int) -> Book:
    """The book of a drive, with the plan of its undisturbed run."""
    scenario = drive.load()
    plan = prepare(scenario, FOLDER / drive.name / "simulator", seed)
    if scenario.can is not None:
        plan = replace(plan, peer=master_of(scenario))
    if drive.board:
        plan = replace(plan, conversion_cycles=BOARD_CODE_CYCLES)
    settings = json.dumps(scenario.model_dump(mode="json"), sort_keys=True)
    sources = [*(Path(__file__).with_name(f"{name}.py") for name in ("judge", "master")), plan.folder / IMAGE_FILE]
    sources += [path for part in ("plant", "cosim") for path in (PACKAGE / part).glob("*.py")]
    return Book(drive, scenario, plan, content_hash(sources, chip_for(drive).key, settings, seed))


def _unchecked(chip: Chip, folder: Path) -> Chip:
    """The simulator without the assertions of the RTL: a bit that flips may break one, which would end the run."""
    script = folder / "unchecked"
    script.write_text(f'#!/bin/sh\nexec "{chip.executable}" +verilator+noassert "$@"\n', encoding="utf-8")
    script.chmod(0o755)
    return replace(chip, executable=script)


def run_share(book: Book, chip: Chip, share: tuple[Run, ...]) -> None:
    """Runs of one moment in one simulator, which is copied for each; all with the RTL's assertions, or all without."""
    registers, image, first = list(population(chip)), image_of(book.scenario), share[0]
    folder = book.plan.folder / first.moment.name / first.folder.name
    folder.mkdir(parents=True, exist_ok=True)
    shutil.copy(book.plan.folder / IMAGE_FILE, folder)
    plan = replace(book.plan, folder=folder, branches=tuple(_branch(run, registers, image) for run in share))
    meta = run_plan(plan, _unchecked(chip, folder) if first.unchecked else chip)
    if meta["fault"]:
        raise SimulatorError(f"the undisturbed run of {first.drive} broke off: {meta['fault']}")


@contextlib.contextmanager
def _alone(drive: Drive) -> Iterator[None]:
    """One process at a time runs a drive's grid: it clears the folders of the runs that are left."""
    folder = FOLDER / drive.name
    with contextlib.ExitStack() as stack:
        try:
            stack.enter_context(alone(folder))
        except InUseError:
            text = "another campaign is using it; wait for its end, or look at what has finished with --show"
            raise ConfigError([Problem("campaign", str(folder), text)]) from None
        yield


def run_drive(
    drive: Drive, seed: int, quick: bool, jobs: int, every: int = 1, done: Done | None = None
) -> list[dict[str, Any]]:
    """All runs of a drive, judged; those finished before with equal inputs are read. jobs 0: only those."""
    runs = grid(drive, seed, quick, every)
    if jobs == 0:
        book = open_book(drive, seed)
        return [row for row in map(book.find, runs) if row is not None]
    with _alone(drive):
        return _run_left(open_book(drive, seed), runs, jobs, done)


def _run_left(book: Book, runs: list[Run], jobs: int, done: Done | None) -> list[dict[str, Any]]:
    """Run what the book has no verdict of; all verdicts."""
    left = [run for run in runs if book.find(run) is None]
    for run in left:
        shutil.rmtree(run.folder, ignore_errors=True)

    def look() -> None:
        for run in [r for r in left if (r.folder / META_FILE).exists() and not (r.folder / ROW_FILE).exists()]:
            with contextlib.suppress(json.JSONDecodeError):  # half written
                book.enter(run)
        if done is not None:
            done(len(runs) - sum(not (run.folder / ROW_FILE).exists() for run in left), len(runs))

    look()
    alike: dict[tuple[str, bool], list[Run]] = {}
    for run in left:
        alike.setdefault((run.moment.name, run.unchecked), []).append(run)
    most = min(SHARE_RUNS, max(1, -(-len(left) // jobs)))
    items = [share for some in alike.values() for share in shares(some, most)]
    if left:
        side_by_side(
            partial(run_share, book, chip_for(book.drive)), items, jobs, lambda *_: None, look, shares_build=True
        )
    return [book.find(run) or book.enter(run) for run in runs]
