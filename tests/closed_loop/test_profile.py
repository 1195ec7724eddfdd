# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""`fluxlock profile`: calls and interrupts of a made-up trace, and sums that agree with what the firmware measures."""

from __future__ import annotations

import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import numpy as np

from fluxlock.analysis.rundata import RunData
from fluxlock.clock import CLOCK_HZ
from fluxlock.config import load_scenario
from fluxlock.memory import RAM_WORDS
from fluxlock.paths import BUILD, ROOT
from fluxlock.profile.command import (
    ALL,
    CONTROL,
    Trace,
    core_load,
    profile_of,
    traced_run,
    write_profile,
)
from fluxlock.profile.elf import Program, read_program
from fluxlock.profile.fold import ROW, fold
from fluxlock.regression.vector import core
from tests.closed_loop.support import SEED

CALL, RETURN, MRET, NOP = 0x000000EF, 0x00008067, 0x30200073, 0x00000013  # jal ra; ret
MAIN, CALLED, ENTRY, HANDLER = 0x100, 0x200, 0x300, 0x400
# The firmware measures a step inside of its handler: entry, exit and what chooses the handler come on top.
AROUND_CLOCKS = (50, 300)
LOAD_POINTS = 0.5


def made_up() -> Program:
    """The main function calls a function at 0x104; an interrupt's entry calls its handler."""
    code = np.full(RAM_WORDS, NOP, np.uint32)
    for place, word in ((MAIN + 4, CALL), (CALLED + 4, RETURN), (ENTRY, CALL), (HANDLER, RETURN), (ENTRY + 4, MRET)):
        code[place // 4] = word
    chain = np.zeros(RAM_WORDS, np.int32)
    for n, place in enumerate((MAIN, CALLED, ENTRY, HANDLER), start=1):
        chain[place // 4 : place // 4 + 64] = n
    return Program(code, chain, (("?",), ("main",), ("called", "inlined"), ("trap_entry",), ("handler",)),
                   {"trap_entry": ENTRY})  # fmt: skip


def write(path: Path, *rows: tuple[int, int, int]) -> Path:
    np.array(list(rows), ROW).tofile(path)
    return path


def test_a_made_up_trace(tmp_path: Path) -> None:
    """Calls nest, an interrupt between a call and its first instruction leaves the stack as it was, no clock is lost.

    Verifies: SYS-19
    """
    interrupt = [(13, ENTRY, 1), (17, HANDLER, 1), (20, ENTRY + 4, 1)]
    # The interrupt comes between the call and the first instruction of what it calls.
    rows = [(10, MAIN, 2), *interrupt, (25, CALLED, 2), (30, MAIN + 8, 3)]
    whole = fold(write(tmp_path / "trace", *rows), made_up())
    assert whole.stacks() == {
        ("main",): 2 + 6,
        ("trap_entry",): 2 + 3,
        ("trap_entry", "handler"): 4,
        ("main", "called", "inlined"): 6,
    }
    assert whole.cycles == 32 - 9 == sum(whole.stacks().values())
    visit = whole.visits[0]
    assert whole.handler(visit) == "handler"
    assert [int(visit[name]) for name in ("depth", "begin", "end", "own")] == [0, 11, 20, 9]
    part = fold(tmp_path / "trace", made_up(), (11, 20), at=18)
    assert part.cycles == 9 and part.path(part.at) == ("trap_entry",)


def test_an_interrupt_within_another(tmp_path: Path) -> None:
    """Its clocks are not those of the one that it interrupts; two in a row return to the same place.

    Verifies: SYS-19
    """
    inner = [(14, ENTRY, 1), (15, HANDLER, 1), (16, ENTRY + 4, 1)]
    again = [(clock + 10, place, count) for clock, place, count in inner]
    rows = [(10, MAIN, 1), (11, ENTRY, 1), (12, HANDLER, 1), *inner, (18, ENTRY + 4, 1), *again]
    rows += [(30, MAIN + 4, 1), (31, CALLED, 2), (33, MAIN + 8, 1)]
    whole = fold(write(tmp_path / "trace", *rows), made_up())
    assert [(int(v["depth"]), int(v["own"])) for v in whole.visits] == [(1, 4), (0, 4), (0, 8)]
    assert whole.stacks()[("main",)] == 1 + 4 + 1
    assert whole.stacks()[("main", "called", "inlined")] == 2


class Traced:
    """A runner of the regression whose runs leave a trace."""

    quick = True

    def drive(self, scenario: str, name: str, *overrides: str) -> Any:
        loaded = load_scenario(ROOT / "scenarios" / scenario, overrides)
        self.folder = BUILD / "closed_loop" / f"profile-{name}"
        span = (0, round(loaded.duration_s * CLOCK_HZ))
        self.trace, self.data = traced_run(loaded, self.folder, SEED, span)
        return SimpleNamespace(data=self.data)


def test_sums_agree_with_the_firmware() -> None:
    """Load of the core in both windows of the case vector/core-load, clocks of the control step, stack, flame graph.

    Verifies: SYS-19
    """
    runner = Traced()
    run, _ = core._run(runner, core.RATES[0])  # type: ignore[arg-type]
    console = "\n".join(run.data.uart)
    readings = [int(now) for now in re.findall(r"^idle \d+ (\d+)\s*$", console, re.MULTILINE)][:4]
    program = read_program(runner.trace.image.with_suffix(".elf"))
    whole = fold(runner.trace.path, program)
    for load, begin, end in zip(core.load_percent(console, 2), readings[::2], readings[1::2], strict=True):
        found = 100.0 * core_load(runner.trace.path, program, whole, (begin, end))
        print(f"load of the core {load:.2f} %, of the profile {found:.2f} %")
        assert abs(found - load) < LOAD_POINTS
    check_numbers(runner.trace, run.data, runner.folder)


def check_numbers(trace: Trace, data: RunData, folder: Path) -> None:
    profile = profile_of(trace)
    rows = np.fromfile(trace.path, ROW)
    traced = int(rows["cycle"][-1] + rows["count"][-1] - rows["cycle"][0])
    assert profile.clocks == sum(profile.stacks.values()) == traced
    control = next(h for h in profile.handlers if h.name == CONTROL)
    for name in ("mean", "max"):
        around = getattr(control, name) - data.isr["control"][name]
        print(f"control step, {name}: {data.isr['control'][name]} clocks and {around:.0f} around them")
        assert AROUND_CLOCKS[0] < around < AROUND_CLOCKS[1]
    assert sum(profile.worst.values()) == profile.worst_clocks == control.max
    assert 0 < profile.stack_bytes < 4096 and profile.stack_path[0] in ("_start", "main", "trap_entry")
    write_profile(profile, "test", folder)
    names = {e.text for e in ElementTree.parse(folder / ALL).iter("{http://www.w3.org/2000/svg}text")}
    assert {"trap_entry", "main"} <= names
