# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Leads a drive by its console through a first turn and a step of its speed, and judges what the console told."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Protocol

from fluxlock.flash.board_console import SilentError
from fluxlock.wiring.reach import pairs

LOOK_S = 0.02
NEAR = 0.01  # of the target: the speed is there
HELD_S = 0.3  # so long
OVERSHOOT = 0.05  # of the step's target
COAST_S = 20.0  # until a stopped rotor rests
SILENT_MS = 500  # of this host, after which the drive switches off by itself


class TurnError(RuntimeError):
    """The machine does not do what it is asked for; the message says what it does, and what to look at."""


class Drive(Protocol):
    """A drive and its clock."""

    def ask(self, line: str) -> list[str]:
        """Reply of its console to a line; its last line is `ok` or `error: TEXT`."""

    def wait(self, seconds: float) -> None:
        """Let time pass."""


@dataclass
class Record:
    """What the console told: time (s), speed and target (r/min), current of the machine (A)."""

    time_s: list[float] = field(default_factory=list)
    speed_rpm: list[float] = field(default_factory=list)
    target_rpm: list[float] = field(default_factory=list)
    current_a: list[float] = field(default_factory=list)


@dataclass(frozen=True)
class Stepped:
    """A step of the speed. overshoot: beyond the target over it; settled_s: from the line to within 1 % for good."""

    overshoot: float
    settled_s: float

    @property
    def passed(self) -> bool:
        """Whether the loops suit the machine."""
        return self.overshoot <= OVERSHOOT


class Lead:
    """Asks a drive to turn. Times are those of the record, which goes on from turn to turn.

    show: called at each look with the drive's state; what it raises ends the turn.
    """

    def __init__(self, drive: Drive, show: Callable[[str, Record], None] = lambda state, record: None) -> None:
        self.drive, self.record, self._show = drive, Record(), show
        self._now_s = 0.0

    @contextmanager
    def within(self, limit_a: float) -> Iterator[None]:
        """A limit of the current for the turns; at their end the gates are off and the settings as before."""
        wanted = {"current_limit_a": f"{limit_a:.3f}", "command_timeout_ms": f"{SILENT_MS}"}
        before = {name: pairs(self.drive.ask(f"get {name}")).get(name, "") for name in (*wanted, "speed_rpm")}
        try:
            for name, value in wanted.items():
                self.order(f"set {name} {value}")
            yield
        finally:
            with contextlib.suppress(SilentError):
                for line in ("stop now", *(f"set {name} {value}" for name, value in before.items())):
                    self.drive.ask(line)

    def order(self, line: str) -> None:
        """A line that the drive has to take. Raises TurnError."""
        reply = self.drive.ask(line)
        if reply[-1] != "ok":
            raise TurnError(f"the drive refuses {line!r}: {' '.join(reply)}")

    def _look(self, target_rpm: float) -> tuple[str, float]:
        self.drive.wait(LOOK_S)
        self._now_s += LOOK_S
        told = pairs(self.drive.ask("status"))
        try:
            state, speed_rpm, current_a = told["state"], float(told["measured_rpm"]), float(told["motor_a"])
        except (KeyError, ValueError):
            raise TurnError(f"the drive's status cannot be read: {told}") from None
        r = self.record
        for values, value in zip(
            (r.time_s, r.speed_rpm, r.target_rpm, r.current_a),
            (self._now_s, speed_rpm, target_rpm, current_a),
            strict=True,
        ):
            values.append(value)
        self._show(state, r)
        if state == "fault":
            fault, phase = told.get("fault", "unknown"), pairs(self.drive.ask("get phase")).get("phase", "none")
            where = f" in the phase {phase}" if phase != "none" else ""
            raise TurnError(f"fault {fault}{where} on the way to {target_rpm:g} r/min (docs/fails/stopped)")
        return state, speed_rpm

    def reach(self, target_rpm: float, patience_s: float) -> Stepped:
        """Set a target and wait until the speed stays there. Raises TurnError."""
        self.order(f"set speed_rpm {round(target_rpm)}")
        if pairs(self.drive.ask("get state")).get("state") == "ready":
            self.order("start")
        begin_s, first, there_s = self._now_s, len(self.record.time_s), None
        state, speed_rpm = "ready", 0.0
        while self._now_s < begin_s + patience_s:
            state, speed_rpm = self._look(target_rpm)
            near = state == "running" and abs(speed_rpm - target_rpm) <= NEAR * abs(target_rpm)
            there_s = (self._now_s if there_s is None else there_s) if near else None
            if there_s is not None and self._now_s >= there_s + HELD_S:
                sign = 1.0 if target_rpm > 0 else -1.0
                most = max(sign * speed for speed in self.record.speed_rpm[first:])
                return Stepped(max(0.0, most / abs(target_rpm) - 1.0), there_s - begin_s)
        raise TurnError(
            f"{speed_rpm:.0f} r/min in the state {state}, {patience_s:g} s after {target_rpm:g} were asked for: "
            "is the shaft free, is the load within the current limit?"
        )

    def rest(self) -> None:
        """Stop, and wait until the drive is ready again. Raises TurnError."""
        self.order("stop")
        end_s = self._now_s + COAST_S
        while self._now_s < end_s:
            if self._look(0.0)[0] == "ready":
                return
        raise TurnError(f"the drive is not ready {COAST_S:g} s after its stop")
