# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Firmware that breaks while the motor runs: the gates open, it starts anew and says why."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from fluxlock.base.paths import ROOT
from fluxlock.clock import CLOCK_HZ
from fluxlock.config import Scenario, load_scenario
from fluxlock.cosim.broken_code import ILLEGAL, MISALIGNED, OUTSIDE, TO_ITSELF, idle_place, rewrite
from fluxlock.cosim.launch import run_plan
from fluxlock.cosim.plan import Action
from fluxlock.cosim.run import chip_of, collect, image_of, prepare
from fluxlock.generate.memory import STACK_ADDRESS, STACK_BYTES
from fluxlock.results.rundata import LogKind, RunData

SPINNING = ("initial.speed_rpm=40000", "window=[]", "expect=[]")
BREAK_S = 0.05
REPORT_S = 1e-3  # a report of the control step, and its window
LOOP_S = 0.2


def run(folder: Path, actions: tuple[Action, ...], seconds: float, scenario: Scenario | None = None) -> RunData:
    """A scenario with actions, default the demo's motor that is caught while it turns."""
    scenario = scenario or load_scenario(ROOT / "scenarios" / "demo.toml", SPINNING)
    plan = prepare(scenario, folder, 1, stop_cycle=round(seconds * CLOCK_HZ))
    commands = ("get state", "get fault", "get restart", "get stack_bytes", "clear", "get state")
    plan = replace(plan, actions=(*plan.actions, *actions), final_commands=commands)
    return collect(plan, run_plan(plan, chip_of(scenario)), scenario.motor.pole_pairs)


def image() -> Path:
    """What the demo runs."""
    return image_of(load_scenario(ROOT / "scenarios" / "demo.toml", SPINNING))


def gates_until_s(data: RunData) -> float:
    """Time of the last gate edge."""
    return float(data.rows(LogKind.GATES)[-1, 0] / CLOCK_HZ)


@pytest.mark.parametrize(("word", "cause"), [(ILLEGAL, 2), (MISALIGNED, 4), (OUTSIDE, 1)])
def test_exception(tmp_path: Path, word: int, cause: int) -> None:
    """An exception opens the gates at once; the firmware starts anew in its fault, knows where, and can be cleared.

    Verifies: FW-92
    """
    at = idle_place(image())
    # For a control tick, in which the main loop has its turn.
    there, back = (rewrite(image(), at, word, round(s * CLOCK_HZ)) for s in (BREAK_S, BREAK_S + 1e-4))
    data = run(tmp_path, (*there, *back), BREAK_S + 0.01)
    print(data.uart[-12:])
    assert BREAK_S < gates_until_s(data) < BREAK_S + 1e-3
    assert "fault exception" in data.uart
    (line,) = [line for line in data.uart if line.startswith("restart ")]
    _, reason, count, mcause, address, value = line.split()
    assert (reason, count, int(mcause)) == ("exception", "1", cause)
    assert int(address, 16) == (at if cause != 1 else at + 0x7F000)
    assert cause == 1 or int(value, 16) == (1 if cause == 4 else word)
    assert data.uart[-2:] == ["state ready", "ok"], "after clear"


def test_main_loop_hangs(tmp_path: Path) -> None:
    """A main loop that goes round in itself opens the gates within its window; the restart names it.

    Verifies: FW-93
    """
    at = idle_place(image())
    end_s = BREAK_S + LOOP_S + 0.01
    # Whole again while the firmware boots.
    moments = (BREAK_S, BREAK_S + LOOP_S + 1e-3)
    there, back = (rewrite(image(), at, TO_ITSELF, round(s * CLOCK_HZ)) for s in moments)
    data = run(tmp_path, (*there, *back), end_s)
    print(data.uart[-12:])
    assert BREAK_S + LOOP_S - 1e-3 < gates_until_s(data) < BREAK_S + LOOP_S + REPORT_S
    assert "fault main_loop" in data.uart
    (line,) = [line for line in data.uart if line.startswith("restart ")]
    assert line.split()[1:3] == ["main_loop", "1"]
    assert int(line.split()[4], 16) == at


def test_stack_overflow(tmp_path: Path) -> None:
    """A stack that has reached its last word is a fault of its own.

    Verifies: FW-94
    """
    data = run(
        tmp_path, (Action(round(BREAK_S * CLOCK_HZ), "memory", {"address": STACK_ADDRESS, "bit": 3}),), BREAK_S + 0.01
    )
    print(data.uart[-12:])
    assert BREAK_S < gates_until_s(data) < BREAK_S + 1e-3
    assert "fault stack_overflow" in data.uart


@pytest.mark.parametrize("name", ["demo", "vector/start", "vector/ipm-injection", "five-phase/yu"])
def test_stack_depth(tmp_path: Path, name: str) -> None:
    """The console tells how deep the stack has been while it printed all values; a quarter of it is left.

    Verifies: FW-94
    """
    events = 'event=[{at_s=0.01, command="get"}]'
    scenario = load_scenario(ROOT / "scenarios" / f"{name}.toml", ("window=[]", "expect=[]", events))
    data = run(tmp_path, (), BREAK_S, scenario)
    print(data.uart[-12:])
    line = [line for line in data.uart if line.startswith("stack_bytes ")][-1]
    assert 300 < int(line.split()[1]) <= 3 * STACK_BYTES // 4
    assert "restart none" in data.uart
