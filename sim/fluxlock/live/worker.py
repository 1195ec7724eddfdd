# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The process that runs a source: takes orders from a pipe, sends rows, status and answers, keeps to the clock.

The firmware exists once a process, and a source that dies does not take the page along. The parent is
`fluxlock.live.link`.
"""

from __future__ import annotations

import signal
import time
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np

from fluxlock.can.sdo import NodeError
from fluxlock.config import ConfigError, Scenario
from fluxlock.firmware.binding import names
from fluxlock.flash.board_console import SilentError
from fluxlock.flash.serial_port import PortError
from fluxlock.live import messages
from fluxlock.live.board import Board, BoardPlan
from fluxlock.live.chip import BrokenError, Chip, ChipPlan
from fluxlock.live.first_start import FirstStartPlan, FirstStartSource
from fluxlock.live.replay import Replay
from fluxlock.live.source import KEPT_S, SLICE_S, RefusedError, Source
from fluxlock.live.traces import NAMES
from fluxlock.live.twin import Twin

STATES = names("drive_state_t")
ROUND_S = 0.03  # between two looks at the pipe
LAG_S = 0.2  # what the clock is ahead by at most
SHARE = 0.3  # of the time factor's mean, that a round adds
Shown = Scenario | Path | BoardPlan | ChipPlan | FirstStartPlan


class Worker:
    """One source and its clock."""

    def __init__(self, pipe: Connection, shown: Shown, seed: int, factor: float) -> None:
        self._pipe, self._shown, self._seed = pipe, shown, seed
        self.wanted, self.reached = factor, 0.0
        self._step_s, self._until = 0.0, "end"  # still to go of a step, and what ends it
        self._begin()

    def _begin(self) -> None:
        shown = self._shown
        self.source: Source
        if isinstance(shown, Path):
            self.source = Replay(shown)
        elif isinstance(shown, BoardPlan):
            self.end()
            self.source = Board(shown)
        elif isinstance(shown, ChipPlan):
            self.end()
            self.source = Chip(shown, self._seed)
        elif isinstance(shown, FirstStartPlan):
            self.end()
            self.source, self._written = FirstStartSource(shown), False
        else:
            self.source = Twin(shown, self._seed)
        self._send({"kind": "hello"} | self.source.hello())
        self._due = time.monotonic()
        self._round: tuple[float, float] | None = None  # begin of the round before, and the source's time there
        self._told = 0
        self._before = 0  # state of the drive before its fault

    def end(self) -> None:
        """End what the source has begun."""
        if isinstance(source := getattr(self, "source", None), Board | Chip | FirstStartSource):
            source.end()

    def _send(self, what: dict[str, Any]) -> None:
        self._pipe.send(what)

    def run(self) -> None:
        """Until the pipe ends."""
        while True:
            wait = 0.0 if self.wanted or self._step_s else ROUND_S
            while self._pipe.poll(wait):
                self._take(self._pipe.recv())
                wait = 0.0
            self._advance()
            self._tell()

    def _take(self, order: messages.Order) -> None:
        try:
            if isinstance(order, messages.Restart):
                self._begin()
            elif isinstance(order, messages.Pace):
                self.wanted, self._step_s, self._due = order.factor, 0.0, time.monotonic()
            elif isinstance(order, messages.Step):
                self.wanted, self._step_s, self._until = 0.0, order.seconds, order.until
            elif isinstance(order, messages.Export):
                texts = self.source.export(order.name)
                self._send({"kind": "files", "texts": texts, "scenario": next(iter(texts))})
            elif isinstance(order, messages.Answer):
                if not isinstance(self.source, FirstStartSource):
                    raise RefusedError("nothing is asked: `fluxlock live SCENARIO --first-start` leads through steps")
                self.source.answer(order.asked, order.yes)
            else:
                self.source.act(order)
        except RefusedError as error:
            self._send({"kind": "error", "text": str(error)})

    def _advance(self) -> None:
        """What the clock has come on by; a source that is too slow for it does not race to catch up."""
        begin, from_s = time.monotonic(), self.source.now
        self._reach(begin, from_s)
        if self._step_s > 0.0:
            while self._step_s > 0.0 and time.monotonic() < begin + ROUND_S:
                before = self.source.now
                came = self.source.advance(min(SLICE_S, self._step_s), self._until)
                self._step_s = 0.0 if came else max(0.0, self._step_s - (self.source.now - before))
                if self._step_s < 1e-9:
                    self._step_s = 0.0
            return
        if self.wanted == 0.0:
            return
        self._due = max(self._due, begin - LAG_S)
        goal_s = from_s + min((begin - self._due) * self.wanted, KEPT_S - 2 * SLICE_S)
        while self.source.now < goal_s - 1e-9 and time.monotonic() < begin + ROUND_S:
            before = self.source.now
            self.source.advance(goal_s - before)
            if self.source.now <= before:  # at the end of a recording, or of a model
                break
        self._due += (self.source.now - from_s) / self.wanted
        rest = begin + ROUND_S - time.monotonic()
        if rest > 0.0:
            self._pipe.poll(rest)

    def _reach(self, begin: float, now_s: float) -> None:
        """Time factor of the rounds until now, with all that a round does beside its simulation; 0 while paused."""
        before, self._round = self._round, (begin, now_s)
        if self.wanted == 0.0:
            self.reached = 0.0
        elif before is not None:
            factor = (now_s - before[1]) / max(begin - before[0], 1e-6)
            self.reached += SHARE * (factor - self.reached)

    def _tell(self) -> None:
        time_s, rows = self.source.take()
        for entry in self.source.said[self._told :]:
            self._send(entry)
        self._told = len(self.source.said)
        if isinstance(self.source, FirstStartSource) and self.source.verdict and not self._written:
            self._written = True
            self._send({"kind": "files", "texts": self.source.written()})
        states = rows[NAMES.index("state")]
        whole = states[np.isfinite(states) & (states != STATES.index("fault"))]
        if whole.size:
            self._before = int(whole[-1])
        status = self.source.status() | {"wanted": self.wanted, "reached": self.reached}
        status["failed_in"] = STATES[self._before] if status["state"] == "fault" else ""
        self._send({"kind": "rows", "time_s": time_s, "rows": rows, "marks": self.source.marks(), "status": status})


def work(pipe: Connection, shown: Shown, seed: int, factor: float) -> None:
    """Run in a process of its own until the other end of the pipe closes; Ctrl-C is the parent's.

    shown: a scenario, whose twin or chip runs, the folder of a finished run, which is shown again, or a board's port.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        Worker(pipe, shown, seed, factor).run()
    except (EOFError, BrokenPipeError, ConnectionResetError):
        return
    except (ConfigError, NodeError, SilentError, PortError, BrokenError, OSError) as error:
        pipe.send({"kind": "died", "text": str(error)})
