# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The console of a board at its serial port."""

from __future__ import annotations

import time
from typing import Protocol

REPLY_S = 1.0  # after which a board is taken for gone


class SilentError(RuntimeError):
    """The board does not answer."""


class Port(Protocol):
    """Of `fluxlock.flash.serial_port.SerialPort`."""

    def write(self, data: bytes) -> None:
        """Send all of it."""

    def read(self, count: int, timeout_s: float) -> bytes:
        """Bytes that came, less than `count` of them if the time is over."""


class Console:
    """Lines to the console of a drive, and its replies."""

    def __init__(self, port: Port) -> None:
        self._port = port
        self._port.write(b"\n")  # ends what it may have got; has no answer
        self._port.read(4096, 0.02)

    def ask(self, line: str) -> list[str]:
        """The reply's lines, the last one `ok` or `error: TEXT`; SilentError."""
        self._port.write(f"{line}\n".encode("ascii"))
        text, end = "", time.monotonic() + REPLY_S
        while time.monotonic() < end:
            text += (self._port.read(1, 0.05) + self._port.read(4096, 0.0)).decode("ascii", errors="replace")
            whole, _, _ = text.rpartition("\n")
            lines = whole.splitlines()
            if lines and (lines[-1].strip() == "ok" or lines[-1].startswith("error: ")):
                return [found.strip() for found in lines if found.strip()]
        raise SilentError(f"no answer to {line!r} within {REPLY_S:g} s: is the drive on, is its firmware running?")
