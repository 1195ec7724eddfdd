# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Console lines of a run, each with the answer that belongs to it. Pure bookkeeping: who uses it sends and listens."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

NO_REPLY = "no reply"


@dataclass
class ConsoleLine:
    """cycle: at which it was wanted. answer: `ok`, `error: TEXT` or `no reply`; None: not known yet."""

    cycle: int
    text: str
    answer: str | None = None


class ConsoleLines:
    """Sends a line when the one before is answered, and pairs lines and answers in order.

    The drive answers each line once, also one that it has got in pieces. It cannot answer what it has not got at
    all. So after `patience_cycles` without a sign of the drive an empty line follows: it ends what the drive may
    have got, and an answer that comes then is that of the line before. After as long again that line has no answer,
    and the next is sent. `stray` counts the answers that nobody waits for.
    """

    def __init__(self, send: Callable[[str], None], patience_cycles: int) -> None:
        self.lines: list[ConsoleLine] = []
        self.stray = 0
        self._send = send
        self._patience = patience_cycles
        self._waiting: deque[ConsoleLine] = deque()  # sent, without an answer
        self._queue: deque[ConsoleLine] = deque()  # not sent yet
        self._since = 0  # last sign of life, or sending
        self._asked = False
        self._rest = ""  # of what was heard, behind the last line feed

    @property
    def settled(self) -> bool:
        """Every line has been sent, and is answered or given up."""
        return not self._waiting and not self._queue

    def add(self, cycle: int, line: str, burst: bool = False) -> ConsoleLine:
        """A line to send now, or when those before are answered; burst: now, whatever is unanswered."""
        added = ConsoleLine(cycle, line)
        self.lines.append(added)
        if burst:
            self._start(added, cycle)
        else:
            self._queue.append(added)
            self._next(cycle)
        return added

    def hear(self, cycle: int, text: str) -> None:
        """What the drive has sent since the last call, maybe nothing."""
        if text:
            self._since = cycle
        *whole, self._rest = (self._rest + text).split("\n")
        for answer in (x.strip() for x in whole):
            if answer != "ok" and not answer.startswith("error: "):
                continue
            if self._waiting:
                self._waiting.popleft().answer = answer
                self._asked = False
            else:
                self.stray += 1
        if self._waiting and cycle - self._since >= self._patience:
            if self._asked:
                self.give_up()
            else:
                self._asked = True
                self._since = cycle
                self._send("")
        self._next(cycle)

    def give_up(self) -> None:
        """Nobody waits for an answer any more to what has been sent."""
        for line in self._waiting:
            line.answer = NO_REPLY
        self._waiting.clear()
        self._asked = False

    def _next(self, cycle: int) -> None:
        if self._queue and not self._waiting:
            self._start(self._queue.popleft(), cycle)

    def _start(self, line: ConsoleLine, cycle: int) -> None:
        self._waiting.append(line)
        self._since = cycle
        self._send(line.text)
