# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Console lines of a run and their answers, against a drive that loses, delays and invents some."""

from __future__ import annotations

import random

import pytest

from fluxlock.cosim.console import NO_REPLY, ConsoleLines

PATIENCE = 1000


class Wire:
    """A drive at the other end: what was sent, and the answers that it gives when told."""

    def __init__(self) -> None:
        self.sent: list[str] = []
        self.lines = ConsoleLines(self.sent.append, PATIENCE)
        self.cycle = 0

    def wait(self, cycles: int, heard: str = "") -> None:
        self.cycle += cycles
        self.lines.hear(self.cycle, heard)

    @property
    def answers(self) -> list[str | None]:
        return [line.answer for line in self.lines.lines]


def test_each_line_waits_for_the_answer_before() -> None:
    """Text of a reply is no answer; a reply in pieces is one; a burst is sent at once and answered in order.

    Verifies: FRONT-17
    """
    wire = Wire()
    for line in ("get", "start"):
        wire.lines.add(wire.cycle, line)
    assert wire.sent == ["get"]
    wire.wait(10, "state ok\nok")
    assert wire.sent == ["get"] and wire.answers == [None, None]
    wire.wait(10, "\r\n")
    assert wire.sent == ["get", "start"] and wire.answers == ["ok", None]
    for line in ("a", "b"):
        wire.lines.add(wire.cycle, line, burst=True)
    assert wire.sent[2:] == ["a", "b"] and not wire.lines.settled
    wire.wait(10, "error: not ready\nok\nerror: bytes lost\n")
    assert wire.answers == ["ok", "error: not ready", "ok", "error: bytes lost"]
    assert wire.lines.settled and wire.lines.stray == 0


def test_a_lost_line_takes_nobody_elses_answer() -> None:
    """Its end was lost: an empty line brings the answer. It was lost as a whole: it has none, and the next is sent.

    Verifies: FRONT-17
    """
    wire = Wire()
    for line in ("first", "second", "third"):
        wire.lines.add(wire.cycle, line)
    wire.wait(PATIENCE - 1)
    assert wire.sent == ["first"]
    wire.wait(1)
    assert wire.sent == ["first", ""]
    wire.wait(5, "error: bytes lost\n")
    assert wire.sent == ["first", "", "second"]
    wire.wait(PATIENCE)
    wire.wait(PATIENCE)
    assert wire.sent == ["first", "", "second", "", "third"]
    wire.wait(5, "ok\n")
    assert wire.answers == ["error: bytes lost", NO_REPLY, "ok"] and wire.lines.settled
    wire.wait(5, "ok\n")
    assert wire.lines.stray == 1 and wire.answers[-1] == "ok"


def test_a_long_reply_is_waited_for() -> None:
    """Every sign of life renews the patience.

    Verifies: FRONT-17
    """
    wire = Wire()
    wire.lines.add(0, "get")
    for _ in range(20):
        wire.wait(PATIENCE - 1, "name value\n")
    wire.wait(PATIENCE - 1, "ok\n")
    assert wire.sent == ["get"] and wire.answers == ["ok"]


@pytest.mark.parametrize("seed", range(5))
def test_answers_stay_with_their_lines(seed: int) -> None:
    """A drive that answers late or hears only parts of lines: no answer ever belongs to another line.

    The drive of this test answers each line by its number, or not at all if it got none or lost its end.

    Verifies: FRONT-17
    """
    draw = random.Random(seed)
    print(f"seed {seed}")
    heard: list[str] = []
    wire = Wire()
    expected: list[str | None] = []
    for n in range(200):
        wire.lines.add(wire.cycle, str(n))
    begun: str | None = None
    while not wire.lines.settled:
        reply = ""
        for text in wire.sent[len(heard) :]:
            heard.append(text)
            if text == "":
                reply += f"error: {begun}\n" if begun is not None else ""
                begun = None
            elif (fate := draw.random()) < 0.1:
                expected.append(NO_REPLY)
            elif fate < 0.2:
                begun = text
                expected.append(f"error: {text}")
            else:
                reply += f"error: {text}\n"
                expected.append(f"error: {text}")
        wire.wait(draw.randint(1, PATIENCE // 2), reply)
    assert wire.answers == expected and wire.lines.stray == 0
    assert NO_REPLY in expected
