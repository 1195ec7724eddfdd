# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A CAN node's protocol, bit by bit (ISO 11898-1): a story told in order, one `yield` a bit.

`level` is what the node sends in the present bit; `step` tells it what the bus showed and goes on to the next one.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Generator
from enum import Enum
from typing import NamedTuple

from .frame import Frame, length, parse, wire

Story = Generator[int, int, None]  # yields levels, is sent what the bus showed
Part = Generator[int, int, bool]  # a part of a frame; returns whether an overload frame must follow
QUIET_BITS = 11
RECOVERY_RUNS = 128


class Fault(Enum):
    """Kinds of error."""

    BIT = "bit"
    STUFF = "stuff"
    FORM = "form"
    ACK = "ack"
    CRC = "crc"


class Start(NamedTuple):
    """How a frame begins: with this node's own or another's, and what of it has been on the bus."""

    own: bool
    seen: list[int]


class _Broken(Exception):
    """An error: `passive` the flag that follows, `unheard` a missing acknowledgement that is not counted yet."""

    def __init__(self, passive: bool, unheard: bool) -> None:
        self.passive, self.unheard = passive, unheard


class _BusOff(Exception):
    pass


class Mac:
    """Protocol of one node. Frames in `queue` are sent in order, each until it has been acknowledged."""

    def __init__(self) -> None:
        self.queue: deque[Frame] = deque()
        self.received: list[Frame] = []
        self.sent: list[Frame] = []
        self.faults: list[Fault] = []
        self.tec = self.rec = 0
        self.bus_off = False
        self.transmitter = False
        self.between = True  # the next bit is in the space between frames, the intermission's first bit excepted
        self._story = self._life()
        self.level = next(self._story)

    @property
    def passive(self) -> bool:
        """Error passive."""
        return self.tec > 127 or self.rec > 127

    def step(self, seen: int) -> None:
        """The bus showed this level at the sample point."""
        self.level = self._story.send(seen)

    def _punish(self, receiver_points: int = 8) -> None:
        if not self.transmitter:
            self.rec = min(255, self.rec + receiver_points)
        elif self.tec + 8 > 255:
            raise _BusOff
        else:
            self.tec += 8

    def _fail(self, fault: Fault, receiver_points: int = 1, counted: bool = True) -> None:
        self.faults.append(fault)
        passive = self.passive
        unheard = fault is Fault.ACK and passive
        if counted and not unheard:
            self._punish(receiver_points)
        raise _Broken(passive, unheard)

    def _life(self) -> Story:
        yield from self._quiet()
        while True:
            try:
                yield from self._alive()
            except _BusOff:
                self.bus_off = self.between = True
                self.transmitter = False
                for _ in range(RECOVERY_RUNS):
                    yield from self._quiet()
                self.bus_off = False
                self.tec = self.rec = 0

    def _quiet(self) -> Story:
        row = 0
        while row < QUIET_BITS:
            row = row + 1 if (yield 1) else 0

    def _alive(self) -> Story:
        while True:
            start: Start | None = yield from self._idle()
            while start is not None:
                start = yield from self._frame(start)

    def _idle(self) -> Generator[int, int, Start]:
        self.transmitter, self.between = False, True
        while True:
            if (yield 1) == 0:
                return Start(False, [0])
            if self.queue:
                return Start(True, [])

    def _frame(self, start: Start) -> Generator[int, int, Start | None]:
        """A frame, the error and overload frames it leads to, the intermission; then how the next frame starts."""
        self.transmitter = start.own
        part = self._transmit(start.seen) if start.own else self._receive(start.seen)
        while True:
            self.between = False
            try:
                overload = yield from part
                if not overload:
                    overload, following = yield from self._intermission()
                if not overload:
                    return following
                part = self._overload_frame()
            except _Broken as broken:
                part = self._error_frame(broken)

    def _transmit(self, seen: list[int]) -> Part:
        raw = list(seen)
        for bit in wire(self.queue[0])[len(seen) :]:
            got = yield bit.level
            if got != bit.level:
                if not (bit.arbitration and bit.level):
                    self._fail(Fault.BIT)
                if bit.stuff:
                    self._fail(Fault.STUFF, counted=False)
                self.transmitter = False
                return (yield from self._receive([*raw, got]))
            raw.append(got)
        if (yield 1) == 0:
            self._fail(Fault.BIT)
        if (yield 1) == 1:
            self._fail(Fault.ACK)
        for _ in range(8):  # delimiter and end of frame
            if (yield 1) == 0:
                self._fail(Fault.BIT)
        self.tec = max(0, self.tec - 1)
        self.sent.append(self.queue.popleft())
        return False

    def _receive(self, seen: list[int]) -> Part:
        bits: list[int] = []
        total: int | None = None
        run, last, place = 0, 1, 0
        while total is None or len(bits) < total or run == 5:
            got = seen[place] if place < len(seen) else (yield 1)
            place += 1
            if run == 5:
                if got == last:
                    self._fail(Fault.STUFF)
                run, last = 1, got
                continue
            run, last = (run + 1 if got == last and bits else 1), got
            bits.append(got)
            if total is None:
                total = length(bits)
        frame, good = parse(bits)
        if (yield 1) == 0:
            self._fail(Fault.FORM)
        acknowledged = yield int(not good)
        if good:
            if acknowledged == 1:
                self._fail(Fault.BIT)
            self.rec = 119 if self.rec > 127 else max(0, self.rec - 1)
        if (yield 1) == 0:
            self._fail(Fault.FORM)
        if not good:
            self._fail(Fault.CRC)
        for _ in range(6):
            if (yield 1) == 0:
                self._fail(Fault.FORM)
        self.received.append(frame)
        return (yield 1) == 0

    def _error_frame(self, broken: _Broken) -> Part:
        if broken.passive:
            row: list[int] = []
            unheard = broken.unheard
            while len(row) < 6 or len(set(row[-6:])) > 1:
                row.append((yield 1))
                if unheard and row[-1] == 0:
                    unheard = False
                    self._punish()
        else:
            yield from self._dominant_flag()
        return (yield from self._delimiter(after_error=True))

    def _overload_frame(self) -> Part:
        yield from self._dominant_flag()
        return (yield from self._delimiter(after_error=False))

    def _dominant_flag(self) -> Story:
        for _ in range(6):
            if (yield 0) == 1:
                self._fail(Fault.BIT, receiver_points=8)

    def _delimiter(self, after_error: bool) -> Part:
        dominant = 0
        while (yield 1) == 0:
            dominant += 1
            if (dominant == 1 and after_error and not self.transmitter) or dominant % 8 == 0:
                self._punish()
        for _ in range(6):
            if (yield 1) == 0:
                self._fail(Fault.FORM)
        return (yield 1) == 0

    def _intermission(self) -> Generator[int, int, tuple[bool, Start | None]]:
        for _ in range(2):
            if (yield 1) == 0:
                self.between = False
                return True, None
            self.between = True
        suspended = self.transmitter and self.passive
        if (yield 1) == 0:
            return False, Start(bool(self.queue) and not suspended, [0])
        for _ in range(8 if suspended else 0):
            if (yield 1) == 0:
                return False, Start(False, [0])
        return False, Start(True, []) if self.queue else None
