# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A serial port of the system at 1 Mbaud, 8N1, raw, without flow control."""

from __future__ import annotations

import os
import select
import termios
import time
import tty
from pathlib import Path
from types import TracebackType


class PortError(RuntimeError):
    """A port that cannot be opened or set up, or that has gone; the message says why."""


def _set_up(line: int) -> None:
    """Make an open tty raw, 1 Mbaud, and drop what came before."""
    tty.setraw(line)
    attributes = termios.tcgetattr(line)
    attributes[2] = termios.CS8 | termios.CREAD | termios.CLOCAL
    attributes[4] = attributes[5] = termios.B1000000
    termios.tcsetattr(line, termios.TCSANOW, attributes)
    termios.tcflush(line, termios.TCIOFLUSH)


class SerialPort:
    """A tty, for `fluxlock.flash.loader`."""

    def __init__(self, path: Path) -> None:
        try:
            self._fd = os.open(path, os.O_RDWR | os.O_NOCTTY)
        except OSError as error:
            raise PortError(f"cannot be opened: {error.strerror}") from None
        try:
            _set_up(self._fd)
        except termios.error as error:
            os.close(self._fd)
            raise PortError(f"does not work as a serial port at 1 Mbaud: {error.args[-1]}") from None

    def __enter__(self) -> SerialPort:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        os.close(self._fd)

    def write(self, data: bytes) -> None:
        """Send all of it; PortError."""
        try:
            while data:
                data = data[os.write(self._fd, data) :]
        except OSError as error:
            raise PortError(f"is gone: {error.strerror}") from None

    def read(self, count: int, timeout_s: float) -> bytes:
        """Bytes that came, less than `count` of them if the time is over; PortError."""
        data = b""
        end = time.monotonic() + timeout_s
        while len(data) < count:
            ready, _, _ = select.select([self._fd], [], [], max(0.0, end - time.monotonic()))
            if not ready:
                break
            try:
                came = os.read(self._fd, count - len(data))
            except OSError as error:
                raise PortError(f"is gone: {error.strerror}") from None
            if not came:
                raise PortError("is gone: the cable is out")
            data += came
        return data
