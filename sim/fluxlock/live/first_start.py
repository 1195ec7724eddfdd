# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A first start as a source: the page asks before each step, and shows the turns while they last."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import numpy as np

from fluxlock.base.stage import Progress, ProgressInfo
from fluxlock.config import Scenario
from fluxlock.firmware.binding import names
from fluxlock.firmware.host import one_at_a_time
from fluxlock.first_start.bench import bench_of
from fluxlock.first_start.guide import ByHandError
from fluxlock.first_start.steps import STEPS, FirstStart
from fluxlock.first_start.turn import Record
from fluxlock.live import messages
from fluxlock.live.source import RefusedError
from fluxlock.live.traces import NAMES, Floats, Marks

CURRENT_SHARE, WAIT_S = 0.6, 60.0
END_S = 30.0  # until a step that is told to stop has done so
STATES = names("drive_state_t")
TOLD = ("measured_rpm", "target_rpm", "motor_a", "state")
WRITTEN = ("first-start.json", "motor.toml", "motor.png", "turns.png")
RESET = "Reset the board at the begin of each step: its loader takes the step's program."
ONLY_STEPS = "a first start goes by its steps: answer the question, or stop it"


@dataclass(frozen=True)
class FirstStartPlan:
    """What its process needs to know. port: of the board, None: a simulated bench. folder: of what it writes."""

    scenario: Scenario
    port: Path | None
    folder: Path


class PageGuide:
    """The page's side of the questions; the steps run in a thread of their own."""

    def __init__(self) -> None:
        self.question, self.busy = "", ""  # what the page asks; what is going on
        self.asked = 0  # questions until now: an answer names its own
        self.ended: dict[str, tuple[bool, str]] = {}
        self.step = 0  # from 1, 0: none has begun
        self.state, self.record = "ready", Record()
        self._answers: SimpleQueue[bool] = SimpleQueue()
        self._stopped = threading.Event()

    def answer(self, asked: int, yes: bool) -> None:
        """The user's answer to a question; a yes to an older one is none, a no stops."""
        if self.question and asked == self.asked:
            self.question = ""
            self._answers.put(yes)
        elif not yes:
            self.busy = "stops"
            self.stop()

    def stop(self) -> None:
        """End it: the step that is under way at its next look, or the question."""
        self._stopped.set()
        self._answers.put(False)

    def _check(self) -> None:
        if self._stopped.is_set():
            raise ByHandError

    def begin(self, number: int, step: str, limits: str) -> None:
        """See `Guide`."""
        self.step = number

    def ask(self, question: str) -> bool:
        """See `Guide`."""
        self._check()
        self.asked += 1
        self.busy, self.question = "", question
        yes = self._answers.get()
        self._check()
        self.busy = "under way"
        return yes

    def end(self, step: str, passed: bool, text: str) -> None:
        """See `Guide`."""
        self.busy = ""
        self.ended[step] = (passed, text)
        self._check()

    @contextmanager
    def progress(self) -> Iterator[Progress]:
        """See `Guide`. A simulated measurement tells from a thread of its own and cannot be ended."""
        mine = threading.get_ident()

        def show(info: ProgressInfo) -> None:
            if threading.get_ident() == mine:
                self._check()
            end = "stops after the measurement: " if self._stopped.is_set() else ""
            self.busy = f"{end}{info.phase}, {info.t_s:.2f} s, {info.speed_rpm:.0f} r/min"

        yield show

    def look(self, state: str, record: Record) -> None:
        """See `Guide`."""
        self.state, self.record = state, record
        self._check()


class FirstStartSource:
    """One first start; its time is that of the turns."""

    def __init__(self, plan: FirstStartPlan) -> None:
        self._plan = plan
        self.guide = PageGuide()
        self.run = FirstStart(plan.scenario, plan.folder, CURRENT_SHARE, self.guide)
        self.said: list[dict[str, Any]] = []
        self.verdict, self._taken = "", 0
        self._thread = threading.Thread(target=self._lead, daemon=True)
        self._thread.start()

    def _lead(self) -> None:
        text = "the first start has ended by an error of its own: see the terminal"
        try:
            with one_at_a_time():
                verdict = self.run.run(bench_of(self._plan.port, WAIT_S, self._plan.folder))
            text = f"{'ok' if verdict.passed else 'failed'}: {'; '.join(verdict.lines)}"
        finally:
            self.guide.busy, self.verdict = "", text
            self.said.append({"kind": "said", "t_s": self.now, "text": text, "answer": ""})

    def end(self) -> None:
        """Stop what is under way, and wait until the gates are off."""
        self.guide.stop()
        self._thread.join(END_S)

    @property
    def now(self) -> float:
        """Time of the newest look, s."""
        return self.guide.record.time_s[-1] if self.guide.record.time_s else 0.0

    def hello(self) -> dict[str, Any]:
        """What a page draws itself from: no knobs, but steps."""
        s = self._plan.scenario
        return {
            "name": s.name,
            "source": "first start",
            "method": f"{s.drive.method}, {'simulated bench' if self._plan.port is None else self._plan.port}",
            "settings": [],
            "faults": [],
            "states": STATES,
            "max_speed_rpm": s.motor.max_speed_rpm,
            "supply_v": s.inverter.supply_v,
            "supply_most_v": s.inverter.protection.over_voltage_v,
            "without": [name for name in NAMES if name not in TOLD],
            "wizard": {
                "steps": [[step, self.run.limits(step)] for step in STEPS],
                "note": RESET if self._plan.port is not None else "",
            },
        }

    def advance(self, seconds: float, until: str = "end") -> bool:
        """Nothing: the steps go on by themselves."""
        return False

    def act(self, action: messages.Action) -> None:
        """RefusedError."""
        raise RefusedError(ONLY_STEPS)

    def answer(self, asked: int, yes: bool) -> None:
        """The user's to the question of this number; RefusedError after the end."""
        if self.verdict:
            raise RefusedError("the first start has ended; `Begin anew` begins another one")
        self.guide.answer(asked, yes)

    def export(self, name: str) -> dict[str, str]:
        """RefusedError."""
        raise RefusedError(f"the report of a first start is {self._plan.folder / WRITTEN[0]}, once it has ended")

    def written(self) -> dict[str, bytes]:
        """What the steps have written, by file name."""
        paths = [self._plan.folder / name for name in WRITTEN]
        return {path.name: path.read_bytes() for path in paths if path.is_file()}

    def take(self) -> tuple[Floats, Floats]:
        """Times and traces of the looks since the last call."""
        r, first = self.guide.record, self._taken
        self._taken = last = min(map(len, (r.time_s, r.speed_rpm, r.target_rpm, r.current_a)))
        rows = np.full((len(NAMES), last - first), np.nan, np.float32)
        states = [float(STATES.index(self.guide.state))] * last
        told = (r.speed_rpm, r.target_rpm, r.current_a, states)
        for name, values in zip(TOLD, told, strict=True):
            rows[NAMES.index(name)] = values[first:last]
        return np.array(r.time_s[first:last], np.float64), rows

    def marks(self) -> Marks:
        """None: a console tells no instants."""
        return []

    def status(self) -> dict[str, Any]:
        """The drive by its own account, and where the steps are."""
        guide, r = self.guide, self.guide.record
        return {
            "t_s": self.now,
            "state": guide.state,
            "phase": "none",
            "fault": "none",
            "limit": "none",
            "lost_locks": 0,
            "target_rpm": r.target_rpm[-1] if r.target_rpm else 0.0,
            "speed_rpm": r.speed_rpm[-1] if r.speed_rpm else 0.0,
            "load_factor": 1.0,
            "supply_v": self._plan.scenario.inverter.supply_v,
            "values": {},
            "wizard": {
                "step": guide.step,
                "ended": {step: list(what) for step, what in guide.ended.items()},
                "question": guide.question,
                "asked": guide.asked,
                "busy": guide.busy,
                "verdict": self.verdict,
            },
        }
