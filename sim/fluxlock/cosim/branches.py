# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Many ends of one run: the simulator's process is copied where they part, each copy goes on with actions of its own.

A copy needs neither start-up nor the time until the moment that is looked at. One copy runs at a time; who wants more
side by side runs more simulators (`fluxlock.workers`).
"""

from __future__ import annotations

import os
import re
import sys
import time
import traceback
from dataclasses import replace
from typing import TYPE_CHECKING

from fluxlock.base.processes import end_with_parent
from fluxlock.cosim.native import peek
from fluxlock.cosim.plan import Action, Branch
from fluxlock.firmware.binding import names
from fluxlock.generate.memory import TELEMETRY_ADDRESS

if TYPE_CHECKING:
    from fluxlock.cosim.session import Session

STATE_ADDRESS = TELEMETRY_ADDRESS + 16  # telemetry.h
STATE_STARTING, STATE_FAULT = (names("drive_state_t").index(state) for state in ("starting", "fault"))
LOOK_CYCLES = 25_000
QUESTIONS, ANSWER_LOOKS = 3, 20
# A drive that is about to start again gets so much longer.
PATIENCE = 3


async def run_branches(session: Session) -> None:
    """Lead the run through its moments, the copies to their ends. Returns in the original process only."""
    plan = session.plan
    pending = sorted(plan.actions, key=lambda a: a.cycle)
    for cycle in sorted({branch.cycle for branch in plan.branches}):
        while pending and pending[0].cycle <= cycle:
            await session.advance(pending[0].cycle)
            session.act(pending.pop(0))
        await session.advance(cycle)
        for branch in (b for b in plan.branches if b.cycle == cycle):
            sys.stdout.flush()
            sys.stderr.flush()
            pid = os.fork()
            if pid == 0:
                await _end_of(session, branch, pending)
            os.waitpid(pid, 0)
    session.planned_lines = len(session.lines.lines)
    session.wall_s = time.perf_counter() - session.begin_s


async def _end_of(session: Session, branch: Branch, planned: list[Action]) -> None:
    """The copy: its actions and those that were planned anyway, until its end; then the process is gone."""
    end_with_parent()
    code = 0
    try:
        branch.folder.mkdir(parents=True, exist_ok=True)
        last = branch.cycle + PATIENCE * branch.cycles
        session.plan = replace(session.plan, folder=branch.folder, branches=(), duration_cycles=last)
        fault: str | None = None
        try:
            await _go_on(session, branch, sorted([*branch.actions, *planned], key=lambda a: a.cycle))
        except Exception as error:  # whatever happens to this copy is its result
            fault = str(error) or type(error).__name__
        session.plan = replace(session.plan, duration_cycles=int(session.native.status.cycle))
        session.save(fault)
    except BaseException:
        traceback.print_exc()
        code = 1
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


async def _look(session: Session) -> str:
    """What the console says within a look."""
    begin = len(session.text)
    await session.wait_until(session.native.status.cycle + LOOK_CYCLES)
    session.drain()
    session.exchange()
    return session.text[begin:]


async def _ask_state(session: Session) -> None:
    """Ask the console for the drive's state; a question that noise before it has spoilt is asked again.

    Errors may be those of lines that the noise has left: the next question waits until the console has told them all.
    """
    for _ in range(QUESTIONS):
        begin = len(session.text)
        session.native.send("status")
        for _ in range(ANSWER_LOOKS):
            said = await _look(session)
            answer = session.text[begin:]
            if re.search(r"^state .*^ok$", answer, re.MULTILINE | re.DOTALL):
                return
            if not said and "\nerror: " in f"\n{answer}":
                break


async def _go_on(session: Session, branch: Branch, actions: list[Action]) -> None:
    """Until the branch's end, earlier when the drive rests in its fault state."""
    faulty_from: int | None = None
    rests_from = max((a.cycle for a in branch.actions), default=branch.cycle)  # its own actions are over
    end = branch.cycle + branch.cycles
    while True:
        now = int(session.native.status.cycle)
        while actions and actions[0].cycle <= now:
            session.act(actions.pop(0))
        if now >= end:
            break
        stop = min(end, now + LOOK_CYCLES, *(a.cycle for a in actions[:1]))
        await session.wait_until(stop)
        session.drain()
        session.exchange()
        session.watched.append([int(peek(address, 1)[0]) for address in session.plan.watch])
        state = int(peek(STATE_ADDRESS, 1)[0])
        if state != STATE_FAULT:
            faulty_from = None
        elif faulty_from is None:
            faulty_from = stop
        elif stop - max(faulty_from, rests_from) >= branch.settle_cycles:
            break
        if state == STATE_STARTING and stop >= end:
            end = min(stop + branch.cycles, branch.cycle + PATIENCE * branch.cycles)
    session.planned_lines = len(session.lines.lines)
    if session.plan.final_commands:
        await session.settle(exchange=True)
        session.lines.give_up()
        await _ask_state(session)
    if session.plan.peer is not None:
        session.conclusion = session.plan.peer.conclusion()
