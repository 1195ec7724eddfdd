# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The host's side of the loader on CAN: python-can, segments, options. The board's link is the loader's own C."""

from __future__ import annotations

import errno
import itertools
import random
import struct
import subprocess
import sys
import threading
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import can
import pytest

from fluxlock.base.paths import ROOT
from fluxlock.config import ConfigError
from fluxlock.flash.can_line import CanLine, PythonCan
from fluxlock.flash.command import flash
from fluxlock.flash.image import pack_can_setup, pack_image, plan
from fluxlock.flash.loader import ERASE, HELLO, START, WRITE, Loader, LoaderError
from tests.flash.link_bench import EXTENDED, REMOTE, TO_HOST, TO_LOADER, Chip, Link, Received

CHANNELS = itertools.count()
NODE = 5


class Board:
    """A board on a bus of python-can: the link's C, and a flash that takes everything."""

    def __init__(self, bus: can.BusABC, loss: float = 0.0) -> None:
        self.bus, self.loss, self.rng = bus, loss, random.Random(1)
        self.flash: dict[int, int] = {}
        self.erased: list[int] = []
        self.lost = self.received = 0
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def stop(self) -> None:
        self._stop.set()
        self._thread.join(10)

    def _answer(self, frame: Received) -> bytes:
        if frame.code == HELLO:
            return struct.pack("<2I", 1, 0xEF4016)
        if frame.code == ERASE:
            self.erased += struct.unpack("<I", frame.payload)
        if frame.code == WRITE:
            self.flash |= dict(enumerate(frame.payload[4:], int.from_bytes(frame.payload[:4], "little")))
        return struct.pack("<I", 0) if frame.code == START else b""

    def _run(self) -> None:
        chip = Chip(pack_can_setup(NODE, 1000), clocks_an_access=2000)
        link = Link(chip)
        while not self._stop.is_set():
            message = self.bus.recv(0.05)
            if message is None:
                continue
            self.received += 1
            if self.rng.random() < self.loss:
                self.lost += 1
                continue
            kind = (EXTENDED if message.is_extended_id else 0) | (REMOTE if message.is_remote_frame else 0)
            chip.hear(message.arbitration_id | kind, bytes(message.data))
            frame = link.receive()
            if frame:
                link.send(frame._replace(code=0, payload=self._answer(frame)))
            for sent in chip.answers():
                assert sent.identifier == (TO_HOST + NODE) | EXTENDED
                self.bus.send(can.Message(arbitration_id=TO_HOST + NODE, is_extended_id=True, data=sent.data))


@contextmanager
def buses(count: int) -> Iterator[list[can.BusABC]]:
    """Members of a bus of this process."""
    channel = f"flash-{next(CHANNELS)}"
    members = [can.Bus(interface="virtual", channel=channel) for _ in range(count)]
    try:
        yield members
    finally:
        for member in members:
            member.shutdown()


def test_upload(monkeypatch: pytest.MonkeyPatch) -> None:
    """An upload through python-can beside other traffic, with frames lost on their way to the board.

    Verifies: BOOT-07
    """
    monkeypatch.setattr("fluxlock.flash.loader.ANSWER_S", 0.2)
    monkeypatch.setattr("fluxlock.flash.loader.TRIES", 20)
    image, block, setup = pack_image(bytes(range(251)) * 9, 3), bytes(range(256)) * 3, pack_can_setup(NODE, 1000)
    steps = plan(image, block, setup)
    with buses(3) as (here, there, other):
        board = Board(there, loss=0.005)
        done = threading.Event()

        def talk() -> None:
            while not done.wait(0.002):
                for identifier in (TO_LOADER + 4, TO_HOST + 4, TO_HOST + NODE - 0x100):
                    other.send(can.Message(arbitration_id=identifier, is_extended_id=True, data=b"\x40" + bytes(7)))
                other.send(can.Message(arbitration_id=0x105, is_extended_id=False, data=bytes(8)))

        noise = threading.Thread(target=talk, daemon=True)
        noise.start()
        loader = Loader(CanLine(PythonCan(here), NODE))
        seen: list[tuple[int, int]] = []
        try:
            assert loader.find(60.0) == (1, 0xEF4016)  # at once, but for a machine that other work holds up
            loader.upload(steps, lambda *step: seen.append(step))
            assert loader.start() == "good"
        finally:
            done.set()
            noise.join(10)
            board.stop()
    assert board.lost > 0
    wanted = {address + i: byte for address, data in steps.write for i, byte in enumerate(data)}
    assert board.flash == wanted and set(board.erased) == set(steps.erase)
    total = len(steps.erase) + len(steps.write)
    assert seen == [(i, total) for i in range(total + 1)]


class Stub:
    """A bus that takes frames or not, and has messages."""

    def __init__(self, error: Exception | None = None, messages: list[can.Message] | None = None) -> None:
        self.error, self.messages = error, messages or []
        self.sent: list[can.Message] = []

    def send(self, message: can.Message, timeout: float) -> None:
        if self.error:
            raise self.error
        self.sent.append(message)

    def recv(self, timeout: float) -> can.Message | None:
        return self.messages.pop(0) if self.messages else None


def answer(data: bytes | None, **changes: object) -> can.Message:
    """A segment as the board of NODE sends it."""
    fields: dict[str, object] = {"arbitration_id": TO_HOST + NODE, "is_extended_id": True, "data": data}
    return can.Message(**(fields | changes))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("bus", "text"),
    [
        (Stub(), "is 5 the node-ID in the board's flash"),
        (Stub(can.CanOperationError("no buffer space", errno.ENOBUFS)), "is the bit rate that of the board"),
        (Stub(can.CanOperationError("Transmit buffer full")), "is the bit rate that of the board"),
        (Stub(None, [can.Message(is_error_frame=True) for _ in range(9)]), "is the bit rate that of the board"),
        (Stub(can.CanOperationError("Network is down", errno.ENETDOWN)), "Network is down"),
    ],
)
def test_silence_is_named(bus: Stub, text: str) -> None:
    """No answer, wrong bit rate or nobody there, failed interface: each has its own text.

    Verifies: BOOT-09
    """
    with pytest.raises(LoaderError, match=text):
        Loader(CanLine(PythonCan(bus), NODE)).find(0.02)  # type: ignore[arg-type]


def test_answers() -> None:
    """Segments of another attempt, another board, a remote or standard frame, an empty one: none belongs to the answer.

    Verifies: BOOT-07
    """
    head = b"\x00\x04\x00\x01\x02\x03\x04"
    crc = struct.pack("<I", zlib.crc32(head))
    first, second = b"\x40" + head, b"\x41" + crc
    others = [
        answer(b"\x80" + first[1:]),
        answer(second, arbitration_id=TO_HOST + 6),
        answer(second, arbitration_id=TO_HOST + NODE - 0x100),
        answer(None, is_remote_frame=True, dlc=5),
        answer(second[:5], arbitration_id=0x105, is_extended_id=False),
        answer(b""),
        answer(b"\x81" + crc),
    ]
    bus = Stub(messages=[answer(second), answer(b"\x42" + crc), answer(first), *others, answer(second)])
    line = CanLine(PythonCan(bus), NODE)  # type: ignore[arg-type]
    line.send(HELLO, b"")
    assert [m.arbitration_id for m in bus.sent] == [TO_LOADER + NODE] and bus.sent[0].is_extended_id
    assert bytes(bus.sent[0].data) == b"\x40\x01\x00\x00" + struct.pack("<I", zlib.crc32(b"\x01\0\0"))
    assert line.receive(1.0) == (0, b"\x01\x02\x03\x04")
    bus.messages = [answer(first), answer(b"\x42" + crc)]  # one is missing
    assert line.receive(0.01) is None


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({}, "--port: is missing"),
        ({"port": Path("README.md"), "can": "virtual:x"}, "leave out --port"),
        ({"port": Path("README.md"), "node": 3}, "--node: 3: has an effect with --can only"),
        ({"port": Path("README.md"), "bit_rate": 500}, "--bit-rate: 500: has an effect with --can only"),
        ({"can": "virtual"}, "must be INTERFACE:CHANNEL"),
    ],
)
def test_options(options: dict[str, Any], text: str) -> None:
    """Options that do not go together are named.

    Verifies: BOOT-09
    """
    with pytest.raises(ConfigError) as error:
        flash(ROOT / "scenarios" / "demo.toml", **options)
    assert [text in str(problem) for problem in error.value.problems] == [True]


def test_command() -> None:
    """A bus without a board ends with one line and exit code 1.

    Verifies: BOOT-09
    """
    words = ["flash", "scenarios/demo.toml", "--can", "virtual:nobody", "--node", "7", "--wait-s", "0.2"]
    command = [sys.executable, "-m", "fluxlock", *words]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 1 and done.stderr.count("\n") == 1, done.stderr
    assert "is 7 the node-ID in the board's flash" in done.stderr
