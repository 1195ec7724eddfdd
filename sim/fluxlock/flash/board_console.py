# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The console of a board at its serial port: lines and replies with checksums."""

from __future__ import annotations

import time
from typing import Protocol

from fluxlock.flash.serial_port import PortError

REPLY_S = 1.0  # of silence, after which a board is taken for gone
TRIES = 3  # of a line that came damaged: the console has not carried it out
MARK = 3  # characters of a checksum, with its star
DAMAGED = ("error: bytes lost", "error: wrong checksum")


class SilentError(RuntimeError):
    """The board does not answer, or not so that it can be read."""


class Port(Protocol):
    """Of `fluxlock.flash.serial_port.SerialPort`."""

    def write(self, data: bytes) -> None:
        """Send all of it."""

    def read(self, count: int, timeout_s: float) -> bytes:
        """Bytes that came, less than `count` of them if the time is over."""


def with_checksum(text: str) -> str:
    """A line with the console's checksum: CRC-8, polynomial 0x07, initial value 0 (docs/reference/console.md)."""
    crc = 0
    for byte in text.encode("ascii", errors="replace"):
        crc ^= byte
        for _ in range(8):
            crc = crc << 1 ^ (0x107 if crc & 0x80 else 0)
    return f"{text}*{crc:02X}"


class Console:
    """Lines to the console of a drive, and its replies."""

    def __init__(self, port: Port) -> None:
        self._port = port
        try:
            self._port.write(b"\n")  # ends what it may have got; has no answer
            self._port.read(4096, 0.02)
        except PortError as error:
            raise SilentError(f"the port {error}") from None

    def ask(self, line: str) -> list[str]:
        """The reply's lines, the last one `ok` or `error: TEXT`; SilentError."""
        for _ in range(TRIES):
            reply = self._ask(line)
            if reply[-1] not in DAMAGED:
                break
        return reply

    def _ask(self, line: str) -> list[str]:
        try:
            return self._exchange(line)
        except PortError as error:
            raise SilentError(f"no answer to {line!r}: the port {error}") from None

    def _exchange(self, line: str) -> list[str]:
        self._port.write(f"{with_checksum(line)}\n".encode("ascii"))
        text, end = "", time.monotonic() + REPLY_S
        while time.monotonic() < end:
            came = self._port.read(1, 0.05) + self._port.read(4096, 0.0)
            if not came:
                continue
            text, end = text + came.decode("ascii", errors="replace"), time.monotonic() + REPLY_S
            whole, _, _ = text.rpartition("\n")
            lines = [found.strip() for found in whole.splitlines() if found.strip()]
            if lines and lines[-1].startswith(("ok*", "error: ")):
                if any(found != with_checksum(found[:-MARK]) for found in lines):
                    raise SilentError(f"the answer to {line!r} came damaged: is the cable long, the port shared?")
                return [found[:-MARK] for found in lines]
        raise SilentError(f"no answer to {line!r} within {REPLY_S:g} s: is the drive on, is its firmware running?")
