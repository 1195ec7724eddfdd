# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The cocotb test that runs the whole chip for `fluxlock.live.chip`, in the simulator's process.

The simulation stands while it waits for the next order, and ends with the other end of the pipe. Chip, plant and logs
are those of a run (`fluxlock.cosim.session`).
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path

import cocotb
import numpy as np
from numpy.typing import NDArray

from fluxlock.base.processes import end_with_parent
from fluxlock.cosim.native import peek
from fluxlock.cosim.plan import PLAN_ENV, Action, SessionPlan
from fluxlock.cosim.session import PlantFault, Session
from fluxlock.firmware.binding import types
from fluxlock.generate.memory import TELEMETRY_ADDRESS
from fluxlock.live.bus import Companion
from fluxlock.results.rundata import RecordArray

LINK_ENV = "FLUXLOCK_LIVE_LINK"  # file number of the pipe


@dataclass(frozen=True)
class Go:
    """Simulate so many clocks, or to the next row of a kind in the log, if there is one before."""

    cycles: int
    until: int = 0


@dataclass(frozen=True)
class Silence:
    """The node beside the drive says nothing from now on, or again what it has to."""

    on: bool


@dataclass(frozen=True)
class Report:
    """What an order has left. fault: why the run has ended; "": it goes on."""

    cycle: int
    log: NDArray[np.int64]  # rows as LogKind says
    records: RecordArray  # a row per event of the plant, at a gate edge two
    answers: tuple[tuple[int, str, str], ...]  # clock, console line and answer
    telemetry: bytes  # telemetry_t
    fault: str


class Simulated:
    """One session, and what was ordered for later."""

    def __init__(self, link: Connection) -> None:
        self._link = link
        self._session = Session(SessionPlan.load(Path(os.environ[PLAN_ENV])))
        self._pending: list[Action] = []
        self._words = types().sizeof("telemetry_t") // 4
        self._session.begin()

    async def serve(self) -> None:
        """Until the pipe ends, or the plant does."""
        fault = ""
        while not fault:
            try:
                order = self._link.recv()
            except EOFError:
                return
            if isinstance(order, Action):
                self._order(order)
                continue
            if isinstance(order, Silence):
                peer = self._session.plan.peer
                assert isinstance(peer, Companion)
                peer.silent = order.on
                continue
            try:
                await self._go(order)
            except (PlantFault, BufferError) as error:
                fault = str(error)
            self._link.send(self._report(fault))

    def _order(self, action: Action) -> None:
        if action.cycle <= self._session.cycle:
            self._session.act(action)
        else:
            self._pending = sorted([*self._pending, action], key=lambda later: later.cycle)

    async def _go(self, order: Go) -> None:
        session, end = self._session, self._session.cycle + order.cycles
        while session.cycle < end:
            stop = min([end, *(action.cycle for action in self._pending[:1])])
            found = order.until != 0 and await self._look(stop, order.until)
            await session.advance(session.cycle if found else stop)
            while self._pending and self._pending[0].cycle <= session.cycle:
                session.act(self._pending.pop(0))
            if found:
                break
        session.drain()

    async def _look(self, stop: int, kind: int) -> bool:
        """Clock by clock, at most to `stop`: whether a row of this kind came."""
        session, status = self._session, self._session.native.status
        seen = int(status.log_count)
        while session.cycle < stop:
            await session.wait_until(session.cycle + 1)
            if status.log_count > seen:
                if (session.native.rows(seen)[:, 1] == kind).any():
                    return True
                seen = int(status.log_count)
        return False

    def _report(self, fault: str) -> Report:
        session = self._session
        log, records = session.log(), session.plant.zoom_records()
        session.logs.clear()
        session.plant.forget()
        session.text = ""
        answered = tuple((x.cycle, x.text, x.answer) for x in session.lines.lines if x.answer is not None)
        session.lines.lines = [x for x in session.lines.lines if x.answer is None]
        telemetry = peek(TELEMETRY_ADDRESS, self._words).tobytes()
        return Report(session.cycle, log, records, answered, telemetry, fault)


@cocotb.test()
async def live(dut: object) -> None:
    """Serve the pipe that the environment names."""
    end_with_parent()
    await Simulated(Connection(int(os.environ[LINK_ENV]))).serve()
