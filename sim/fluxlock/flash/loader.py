# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The loader's protocol (docs/reference/boot.md), its frames on a serial line, the upload of image and parameter block.

Frames on CAN: `fluxlock.flash.can_line`.
"""

from __future__ import annotations

import struct
import time
import zlib
from collections.abc import Callable
from typing import Protocol

from fluxlock.flash.image import Plan

SYNC = 0xA5
HELLO, ERASE, WRITE, CHECK, START = range(1, 6)
RESULTS = ("done", "unknown command", "wrong address or length", "the flash did not erase or write", "refused")
# Of sw/images/boot/main.c.
REASONS = (
    "good",
    "no flash",
    "no image",
    "image header CRC",
    "image format",
    "image is for another chip",
    "image length",
    "image CRC",
    "no parameter block",
    "parameter block version",
    "parameter block length",
    "parameter block CRC",
)
HELLO_S = 0.05
TRIES = 3
# Longest time of an answer, beyond the bytes on the line: the loader waits 2 s for an erase.
ANSWER_S = 3.0


class LoaderError(RuntimeError):
    """No loader answers, or it refuses."""


class Port(Protocol):
    """A serial line."""

    def write(self, data: bytes) -> None:
        """Send all of it."""

    def read(self, count: int, timeout_s: float) -> bytes:
        """Bytes that came, less than `count` of them if the time is over."""


class Line(Protocol):
    """What carries frames."""

    def send(self, code: int, payload: bytes) -> None:
        """A command; what came before is no answer to it."""

    def receive(self, timeout_s: float) -> tuple[int, bytes] | None:
        """Code and payload of the next whole frame that is right; None: there is none in time."""

    def trouble(self) -> str:
        """What the line knows of why there is no answer; empty: nothing."""


def pack(code: int, payload: bytes = b"") -> bytes:
    """A command or an answer with its CRC."""
    body = struct.pack("<BH", code, len(payload)) + payload
    return body + struct.pack("<I", zlib.crc32(body))


def unpack(packed: bytes) -> tuple[int, bytes] | None:
    """Code and payload; None: not right, or not all of it."""
    if len(packed) < 7:
        return None
    code, length = struct.unpack_from("<BH", packed)
    body, crc = packed[: 3 + length], packed[3 + length : 7 + length]
    return (int(code), body[3:]) if crc == struct.pack("<I", zlib.crc32(body)) else None


def frame(code: int, payload: bytes = b"") -> bytes:
    """Frame of a command or an answer on a serial line."""
    return bytes([SYNC]) + pack(code, payload)


def read_frame(port: Port, timeout_s: float) -> tuple[int, bytes] | None:
    """Code and payload of the next whole frame; what is none, such as a line of text, is passed over."""
    while True:
        first = port.read(1, timeout_s)
        if not first:
            return None
        if first[0] != SYNC:
            continue
        head = port.read(3, timeout_s)
        if len(head) < 3:
            return None
        (length,) = struct.unpack_from("<H", head, 1)
        rest = port.read(length + 4, timeout_s)
        if len(rest) < length + 4:
            return None
        if found := unpack(head + rest):
            return found


class SerialLine:
    """Frames on a serial line."""

    def __init__(self, port: Port) -> None:
        self.port = port

    def send(self, code: int, payload: bytes) -> None:
        """See `Line`."""
        self.port.write(frame(code, payload))

    def receive(self, timeout_s: float) -> tuple[int, bytes] | None:
        """See `Line`."""
        return read_frame(self.port, timeout_s)

    def trouble(self) -> str:
        """A serial line sees nothing of its other end."""
        return ""


class Loader:
    """The loader at the other end of a line."""

    def __init__(self, line: Line) -> None:
        self.line = line

    def _silence(self, text: str) -> LoaderError:
        trouble = self.line.trouble()
        return LoaderError(f"{text}; {trouble}" if trouble else text)

    def _ask(self, code: int, payload: bytes = b"", length: int = 0) -> tuple[int, bytes]:
        """Answer to a command, which is repeated if there is none: all commands may be done twice.

        length: payload of the answer in bytes if nothing is wrong. Another one is a late answer to another command.
        """
        for _ in range(TRIES):
            self.line.send(code, payload)
            while answer := self.line.receive(ANSWER_S):
                if answer[0] or len(answer[1]) == length:
                    return answer
        raise self._silence("the loader stopped answering: reset the board and run the command again")

    def _do(self, what: str, code: int, payload: bytes) -> None:
        result, _ = self._ask(code, payload)
        if result:
            raise LoaderError(f"{what}: {RESULTS[result] if result < len(RESULTS) else result}")

    def find(self, wait_s: float) -> tuple[int, int]:
        """Version of the loader and identity of the flash; asks until a chip that has been reset answers."""
        end = time.monotonic() + wait_s
        while time.monotonic() < end:
            self.line.send(HELLO, b"")
            answer = self.line.receive(HELLO_S)
            if answer and answer[0] == 0 and len(answer[1]) == 8:
                while self.line.receive(HELLO_S):
                    pass  # the loader may have heard more than one
                version, identity = struct.unpack("<2I", answer[1])
                return version, identity
        raise self._silence("no loader answers: reset the board while this waits")

    def upload(self, plan: Plan, progress: Callable[[int, int], None] = lambda done, total: None) -> None:
        """Erase and write; progress: called with steps done and their number."""
        total = len(plan.erase) + len(plan.write)
        for done, address in enumerate(plan.erase):
            progress(done, total)
            self._do(f"erase at {address:#x}", ERASE, struct.pack("<I", address))
        for done, (address, data) in enumerate(plan.write, len(plan.erase)):
            progress(done, total)
            self._do(f"write at {address:#x}", WRITE, struct.pack("<I", address) + data)
        progress(total, total)

    def _judge(self, code: int) -> str:
        _, payload = self._ask(code, length=4)
        (reason,) = struct.unpack("<I", payload) if len(payload) == 4 else (-1,)
        return REASONS[reason] if 0 <= reason < len(REASONS) else f"unknown answer {payload.hex()}"

    def check(self) -> str:
        """What the loader finds in the flash: "good", or what is wrong."""
        return self._judge(CHECK)

    def start(self) -> str:
        """Start what is in the flash: "good", or why it is not started."""
        return self._judge(START)
