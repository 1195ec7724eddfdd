# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The cocotb test that drives the whole chip through one plan. Runs inside the simulator's process.

The clock and the plant are native; this coroutine sleeps until the next action of the plan or until the logs want
draining (`Session.advance`).
"""

from __future__ import annotations

import gc
import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import cocotb

from fluxlock.base.processes import end_with_parent
from fluxlock.cosim.branches import run_branches
from fluxlock.cosim.console import NO_REPLY
from fluxlock.cosim.plan import PLAN_ENV, RECORDING_FILE, ConversationError, Dialogue, SessionPlan
from fluxlock.cosim.session import BOOT_CYCLES, LISTEN_CYCLES, REPLY_S, ConsoleSilent, PlantFault, Session
from fluxlock.results.rundata import SimulationFault

# What numba loads when it is there, for linear algebra and for reports of coverage: a quarter of a second.
FOR_NUMBA = ("scipy", "coverage")


@contextmanager
def numba_alone() -> Iterator[None]:
    """The plant's kernel is all that is compiled here: meanwhile numba does not find what it takes for other code.

    Nor is garbage sought: what is loaded stays.
    """
    gc.disable()
    absent = [name for name in FOR_NUMBA if name not in sys.modules]
    for name in absent:
        sys.modules[name] = None  # type: ignore[assignment]  # None makes an import fail, the stubs know modules only
    try:
        yield
    finally:
        for name in absent:
            del sys.modules[name]
        gc.freeze()
        gc.enable()


def session_of(plan: SessionPlan) -> Session:
    """Of a plan; a load of the user's own may use numba as it likes."""
    if plan.own_load is not None:
        return Session(plan)
    with numba_alone():
        return Session(plan)


async def run(session: Session) -> None:
    """Run the session's plan to its end, then ask the chip for its statistics."""
    plan = session.plan
    session.begin()
    if plan.dialogue is not None:
        await converse(session, plan.dialogue)
    elif plan.branches:
        await run_branches(session)
    else:
        await carry_out(session)
        await ask_statistics(session)


async def carry_out(session: Session) -> None:
    """Carry out the plan's actions at their clocks, until its end or until its peer has finished."""
    plan, native = session.plan, session.native
    end = plan.duration_cycles
    pending = sorted(plan.actions, key=lambda a: a.cycle)
    for stop in sorted({cycle for cycle in (*(a.cycle for a in plan.actions), *plan.marks, end) if cycle <= end}):
        await session.advance(stop)
        if session.cycle < stop:
            break
        if stop in plan.marks:
            session.marks[stop] = (session.woken_s, session.python_s, native.status.events)
        while pending and pending[0].cycle <= stop:
            session.act(pending.pop(0))
    session.wall_s = time.perf_counter() - session.begin_s
    if plan.peer is not None:
        session.conclusion = plan.peer.conclusion()
    native.record(False)
    if plan.recording:
        native.save_recording(plan.folder / RECORDING_FILE)
    if plan.trace is not None:
        session.stack = native.end_trace()
    if session.debugger is not None:
        session.debugger.end()
        session.debugger = None
    session.log_end = sum(map(len, session.logs))
    session.end_cycle = session.cycle


async def converse(session: Session, dialogue: Dialogue) -> None:
    """Lead a dialogue to its end."""
    await session.wait_until(BOOT_CYCLES)
    talk = dialogue.conversation()
    try:
        line = next(talk)
        while True:
            line = talk.send(await reply_to(session, line))
    except StopIteration as end:
        session.conclusion = end.value
    session.wall_s = time.perf_counter() - session.begin_s


async def reply_to(session: Session, line: str) -> list[str]:
    """Send a line of a dialogue and wait for the last one of its reply."""
    count, begin = len(session.replies()), len(session.text)
    session.native.send(line)
    while len(session.replies()) == count:
        if session.cycle >= session.plan.duration_cycles:
            raise ConversationError(f"not at the end after {session.cycle / session.plan.clock_hz:g} s")
        await session.wait_until(session.cycle + LISTEN_CYCLES)
        session.drain()
    return session.text[begin:].splitlines()


async def ask_statistics(session: Session) -> None:
    """Wait for the answers to the plan's lines, then send the final commands one by one and wait for each."""
    await session.settle()
    session.planned_lines = len(session.lines.lines)
    for command in session.plan.final_commands:
        line = session.lines.add(session.cycle, command)
        await session.settle()
        if line.answer in (None, NO_REPLY):
            raise ConsoleSilent(f"the drive's console did not answer {command!r} within {2 * REPLY_S:g} s")


@cocotb.test()
async def drive(dut: object) -> None:
    """Run the plan named by the environment."""
    end_with_parent()
    session = session_of(SessionPlan.load(Path(os.environ[PLAN_ENV])))
    fault: str | None = None
    try:
        await run(session)
    except (PlantFault, ConsoleSilent, ConversationError, BufferError, SimulationFault) as error:
        fault = str(error)
    session.save(fault)
