# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""`fluxlock profile`: run a scenario with the core's trace, print where its clocks went, draw flame graphs."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from fluxlock.base.stage import Progress, tell_building
from fluxlock.clock import CLOCK_HZ
from fluxlock.config import Scenario
from fluxlock.cosim.launch import SimulatorError, run_plan
from fluxlock.cosim.plan import TRACE_FILE
from fluxlock.cosim.run import chip_of, collect, image_of, prepare
from fluxlock.generate.memory import BLOCK_ADDRESS, STACK_BYTES
from fluxlock.generate.registers import check_build, generate_registers
from fluxlock.profile.elf import Program, read_program
from fluxlock.profile.flame import Stacks, flame_graph, folded
from fluxlock.profile.fold import ROW, Folded, fold
from fluxlock.results.rundata import RunData, SimulationFault

CONTROL = "trap_control"  # sw/hal/soc/trap.S calls the control step by this name
MAIN, POLL = "main", "app_poll"  # the main loop, and with what a round of it begins
SHOWN = 20  # rows of a table
LONGEST = 5  # control steps whose way is shown
ALL, WORST = "flame.svg", "worst-step.svg"
FOLDED, RESULT = "profile.folded", "profile.json"


@dataclass(frozen=True)
class Handler:
    """Clocks of an interrupt handler from the last instruction before the trap entry to its `mret`.

    min, mean, max: without interrupts within it; longest: with them. share: of all clocks.
    """

    name: str
    count: int
    min: int
    mean: float
    max: int
    longest: int
    share: float


@dataclass(frozen=True)
class Function:
    """Clocks in a function itself and with all that it calls, over the whole trace."""

    name: str
    self_clocks: int
    all_clocks: int


@dataclass(frozen=True)
class Step:
    """One control step: when it began, and its clocks. path: see `_heaviest`; path_clocks: its last function itself."""

    begin_s: float
    clocks: int
    path: tuple[str, ...]
    path_clocks: int


@dataclass(frozen=True)
class Profile:
    """What a trace says. load: `core_load`. longest: control steps, the longest first; worst: clocks of the first."""

    image: str
    clocks: int
    load: float
    handlers: tuple[Handler, ...]
    functions: tuple[Function, ...]
    longest: tuple[Step, ...]
    worst: Stacks
    stack_bytes: int
    stack_path: tuple[str, ...]
    stacks: Stacks


@dataclass(frozen=True)
class Trace:
    """A trace of a run; lowest: stack pointer, and the clock at which it was so low."""

    path: Path
    image: Path
    lowest: int
    lowest_at: int


def traced_run(
    scenario: Scenario, out_dir: Path, seed: int, span: tuple[int, int], progress: Progress | None = None
) -> tuple[Trace, RunData]:
    """Run a scenario on the chip that shows its core; trace the clocks of `span`, from..to, where it ends."""
    tell_building(progress, span[1] / CLOCK_HZ, "chip")
    image = image_of(scenario)
    try:
        generate_registers()
        chip = chip_of(scenario, probe=True)
        plan = prepare(scenario, out_dir / "simulator", seed, trace=span, stop_cycle=span[1])
        meta = run_plan(plan, chip, progress)
    except (SimulatorError, RuntimeError) as error:
        raise SimulationFault(str(error)) from error
    data = collect(plan, meta, scenario.motor.pole_pairs)
    if meta["fault"]:
        raise SimulationFault(meta["fault"], data)
    return Trace(plan.folder / TRACE_FILE, image, *meta["stack"]), data


def profile_of(trace: Trace) -> Profile:
    """What a trace says."""
    program = read_program(trace.image.with_suffix(".elf"))
    whole = fold(trace.path, program, at=trace.lowest_at)
    stacks = whole.stacks()
    steps = whole.visits[[whole.handler(v) == CONTROL for v in whole.visits]]
    steps = steps[np.argsort(-steps["own"], kind="stable")][:LONGEST]
    parts = [_control_part(fold(trace.path, program, (int(v["begin"]), int(v["end"])))) for v in steps]
    return Profile(
        image=trace.image.stem.rpartition("-")[0],
        clocks=whole.cycles,
        load=core_load(trace.path, program, whole),
        handlers=tuple(_handlers(whole)),
        functions=tuple(_functions(stacks)),
        longest=tuple(
            Step(float(v["begin"]) / CLOCK_HZ, int(v["own"]), *_heaviest(part))
            for v, part in zip(steps, parts, strict=True)
        ),
        worst=parts[0] if parts else {},
        stack_bytes=BLOCK_ADDRESS - trace.lowest,
        stack_path=whole.path(whole.at) if whole.at >= 0 else (),
        stacks=stacks,
    )


def core_load(trace: Path, program: Program, whole: Folded, span: tuple[int, int] | None = None) -> float:
    """Share of the clocks that are not the main loop's, as the firmware finds it (`get idle`, sw/app/app.c).

    A round of the main loop counts with what it takes when nothing interrupts it. So the load has all interrupts, what
    they leave to the loop, such as lines of the cache to fetch anew, and the loop's answers on the console, that with
    which the span begins too.
    """
    rounds = _rounds(np.fromfile(trace, ROW), program)
    begin, end = span or (int(rounds[0]), int(rounds[-1]))
    rounds = rounds[(rounds >= begin) & (rounds <= end)]
    begins = whole.visits["begin"][whole.visits["depth"] == 0]
    lengths = np.diff(rounds)
    quiet = lengths[np.histogram(begins, rounds)[0] == 0]
    return 1.0 - len(lengths) * float(np.median(quiet)) / float(end - begin)


def _rounds(rows: NDArray[Any], program: Program) -> NDArray[np.int64]:
    """Clocks at which the main loop comes to what it polls: from another part of main(), not back from a call."""
    polls = np.array([chain[0] == MAIN and POLL in chain for chain in program.chains])
    others = np.array([chain[0] == MAIN and POLL not in chain for chain in program.chains])
    begins = program.chain[rows["pc"][1:] // 4]
    ends = program.chain[rows["pc"][:-1] // 4 + rows["count"][:-1] - 1]
    found: NDArray[np.int64] = rows["cycle"][1:][polls[begins] & others[ends]]
    return found


def _control_part(part: Folded) -> Stacks:
    """Of one control step's clocks those of itself, without an interrupt within it."""
    return {path: n for path, n in part.stacks().items() if path[1:2] in ((), (CONTROL,))}


def _heaviest(part: Stacks) -> tuple[tuple[str, ...], int]:
    """From the outermost call to the callee with most clocks, until a function itself takes as many; its own clocks."""
    way: tuple[str, ...] = ()
    while True:
        below: dict[str, int] = {}
        for path, clocks in part.items():
            if len(path) > len(way) and path[: len(way)] == way:
                below[path[len(way)]] = below.get(path[len(way)], 0) + clocks
        name = max(below, key=lambda n: below[n], default="")
        if part.get(way, 0) >= below.get(name, 0):
            return way, part.get(way, 0)
        way = (*way, name)


def _handlers(whole: Folded) -> Iterator[Handler]:
    names = np.array([whole.handler(visit) for visit in whole.visits])
    for name in sorted(set(names.tolist())):
        visits = whole.visits[names == name]
        own, spans = visits["own"], visits["end"] - visits["begin"]
        share = int(own.sum()) / max(whole.cycles, 1)
        clocks = (int(own.min()), float(own.mean()), int(own.max()), int(spans.max()))
        yield Handler(name, len(visits), *clocks, share)


def _functions(stacks: Stacks) -> list[Function]:
    """Most clocks of their own first."""
    own: dict[str, int] = {}
    whole: dict[str, int] = {}
    for path, clocks in stacks.items():
        own[path[-1]] = own.get(path[-1], 0) + clocks
        for name in set(path):
            whole[name] = whole.get(name, 0) + clocks
    return sorted((Function(n, own.get(n, 0), c) for n, c in whole.items()), key=lambda f: (-f.self_clocks, f.name))


def write_profile(profile: Profile, title: str, out_dir: Path) -> None:
    """Write the numbers, the folded stacks and the flame graphs."""
    (out_dir / FOLDED).write_text(folded(profile.stacks), encoding="utf-8")
    (out_dir / ALL).write_text(flame_graph(profile.stacks, title), encoding="utf-8")
    (out_dir / WORST).write_text(flame_graph(profile.worst, f"{title}: longest control step"), encoding="utf-8")
    numbers = {name: value for name, value in asdict(profile).items() if name not in ("stacks", "worst")}
    numbers["worst"] = {";".join(path): clocks for path, clocks in profile.worst.items()}
    (out_dir / RESULT).write_text(json.dumps(numbers, indent=1) + "\n", encoding="utf-8")


def print_profile(profile: Profile, console: Console) -> None:
    """Tables for a terminal."""
    console.print(_table("interrupts, clocks", ("handler", "count", "min", "mean", "max", "longest", "load %"), [
        (h.name, h.count, h.min, f"{h.mean:.1f}", h.max, h.longest, f"{100 * h.share:.2f}") for h in profile.handlers
    ]))  # fmt: skip
    total = max(profile.clocks, 1)
    console.print(_table("functions, clocks", ("function", "itself", "%", "with callees", "%"), [
        (f.name, f.self_clocks, f"{100 * f.self_clocks / total:.2f}", f.all_clocks, f"{100 * f.all_clocks / total:.2f}")
        for f in profile.functions[:SHOWN]
    ]))  # fmt: skip
    if profile.longest:
        console.print(_table("longest control steps", ("calls with most clocks", "last itself", "clocks", "at s"), [
            (" > ".join(step.path), step.path_clocks, step.clocks, f"{step.begin_s:.6f}") for step in profile.longest
        ]))  # fmt: skip
        title = f"longest control step: {profile.longest[0].clocks} clocks at {profile.longest[0].begin_s:.6f} s"
        rows = [(f.name, f.self_clocks, f.all_clocks) for f in _functions(profile.worst)[:SHOWN]]
        console.print(_table(title, ("function", "itself", "with callees"), rows))
    console.print(
        f"core load {100 * profile.load:.2f} % of {profile.clocks} clocks, image {profile.image}", highlight=False
    )
    where = " > ".join(profile.stack_path)
    console.print(f"stack {profile.stack_bytes} of {STACK_BYTES} bytes, deepest in {where}", highlight=False)


def _table(title: str, columns: tuple[str, ...], rows: list[tuple[Any, ...]]) -> Table:
    table = Table(title=title, title_justify="left")
    for n, name in enumerate(columns):
        table.add_column(name, justify="right" if n else "left")
    for row in rows:
        table.add_row(*map(str, row))
    return table


def run_profile(
    scenario: Scenario, out_dir: Path, seed: int, span: tuple[int, int], progress: Progress, console: Console
) -> None:
    """Run, fold, write, print."""
    check_build()
    trace, _ = traced_run(scenario, out_dir, seed, span, progress)
    profile = profile_of(trace)
    write_profile(profile, scenario.name, out_dir)
    print_profile(profile, console)
    trace.path.unlink()
    console.print(f"written: {out_dir}/{', '.join((RESULT, FOLDED, ALL, WORST))}", highlight=False, soft_wrap=True)
