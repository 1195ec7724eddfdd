# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""`fluxlock profile`: calls and interrupts of a made-up trace, and sums that agree with what the firmware measures."""

from __future__ import annotations

import json
import re
import shlex
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import numpy as np

from fluxlock.base.paths import BUILD, ROOT
from fluxlock.clock import CLOCK_HZ
from fluxlock.config import load_scenario
from fluxlock.generate.memory import RAM_WORDS
from fluxlock.profile.command import (
    ALL,
    CONTROL,
    LONGEST,
    Trace,
    _heaviest,
    core_load,
    profile_of,
    traced_run,
    write_profile,
)
from fluxlock.profile.elf import Program, read_program
from fluxlock.profile.fold import ROW, fold
from fluxlock.results.rundata import RunData
from fluxverify.regression.vector import core
from tests.closed_loop.support import SEED

CALL, RETURN, MRET, NOP = 0x000000EF, 0x00008067, 0x30200073, 0x00000013  # jal ra; ret
MAIN, CALLED, ENTRY, HANDLER = 0x100, 0x200, 0x300, 0x400
# The firmware measures a step inside of its handler: entry, exit and what chooses the handler come on top.
AROUND_CLOCKS = (50, 300)
LOAD_POINTS = 0.5
PAGE = ROOT / "docs" / "howto" / "firmware" / "profile.md"


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


def test_the_way_of_most_clocks() -> None:
    """It follows the callee with most clocks of all below, and ends where a function itself has more.

    Verifies: SYS-19
    """
    many = {("a",): 1, ("a", "b"): 2, ("a", "b", "c"): 3, ("a", "b", "d"): 4, ("a", "e"): 8}
    assert _heaviest(many) == (("a", "b", "d"), 4)
    assert _heaviest({("a",): 9, ("a", "b"): 8}) == (("a",), 9)
    assert _heaviest({}) == ((), 0)


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
    run, _ = core._run(runner, core.RATES[0])  # type: ignore[arg-type] # has what the row asks of a Runner
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
    assert sum(profile.worst.values()) == profile.longest[0].clocks == control.max
    lengths = [step.clocks for step in profile.longest]
    assert len(lengths) == LONGEST and lengths == sorted(lengths, reverse=True)
    assert all(CONTROL in step.path and 0 < step.path_clocks < step.clocks for step in profile.longest)
    assert profile.worst[profile.longest[0].path] == profile.longest[0].path_clocks
    assert 0 < profile.stack_bytes < 4096 and profile.stack_path[0] in ("_start", "main", "trap_entry")
    write_profile(profile, "test", folder)
    names = {e.text for e in ElementTree.parse(folder / ALL).iter("{http://www.w3.org/2000/svg}text")}
    assert {"trap_entry", "main"} <= names


def command(*more: str) -> subprocess.CompletedProcess[str]:
    """The command of the page, shortened."""
    found = re.search(r"^\.venv/bin/(fluxlock profile .*)$", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    assert found
    words = shlex.split(found[1])[1:]
    line = [sys.executable, "-m", "fluxlock", *words, *more]
    return subprocess.run(line, cwd=ROOT, capture_output=True, text=True, check=False)


def test_the_page() -> None:
    """Its command prints the tables and writes the files that the page names, for the part that is asked for.

    Verifies: SYS-19
    """
    out = BUILD / "closed_loop" / "profile-page"
    done = command("--out", str(out), "--from", "0.01", "--to", "0.03")
    print(done.stdout, done.stderr)
    assert done.returncode == 0 and done.stderr.startswith("building chip ")
    assert all(
        text in done.stdout
        for text in ("trap_control", "longest control steps", "longest control step:", "core load", "stack ")
    )
    named = re.findall(r"^\| `([\w.-]+)` \|", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    assert len(named) == 4 and all((out / name).stat().st_size for name in named)
    numbers = json.loads((out / "profile.json").read_text())
    assert abs(numbers["clocks"] - 0.02 * CLOCK_HZ) < 100
    assert not list(out.glob("**/core.trace"))


def test_a_wrong_span() -> None:
    """A part beyond the run is one line.

    Verifies: SYS-19
    """
    done = command("--from", "0.2")
    assert done.returncode == 2 and "--to: 0.1: must be after --from" in done.stderr
