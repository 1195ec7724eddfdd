# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Joins the bus of the simulated chip to this process: frames both ways between the simulator's process and ours.

In the simulator a node on the chip's bus (`LinkPeer`) sends what comes and takes what the chip sends, every
`batch_cycles`. Here `CanLink` hands the frames on. A socket between the two; nothing is lost or overtaken: what the bus
cannot carry yet waits in the simulator's process.
"""

from __future__ import annotations

import contextlib
import os
import socket
import tempfile
import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from multiprocessing.connection import Client, Connection, Listener
from pathlib import Path

from fluxlock.can.frame import Frame
from fluxlock.can.timing import BitTiming
from fluxlock.cosim.plan import CanSide

# In the node's queue: enough that the bus never waits for the next wake-up.
QUEUE = 8
# Wake-ups between two reports of the time.
REPORT = 20


@dataclass(frozen=True)
class Report:
    """How far the simulator has come. waiting: frames for the bus that have not been sent."""

    cycle: int
    waiting: int


@dataclass
class LinkPeer:
    """The simulator's end."""

    timing: BitTiming
    address: str
    finished: bool = False
    _socket: Connection | None = None
    _waiting: deque[Frame] = field(default_factory=deque)
    _wakes: int = 0
    _sent: int = 0  # by the chip
    _taken: int = 0  # for the chip

    def exchange(self, cycle: int, node: CanSide) -> None:
        """Hand on what either side has sent; a closed socket ends the run."""
        try:
            if self._socket is None:
                self._socket = Client(self.address, "AF_UNIX")
            while (frame := node.take()) is not None:
                self._socket.send(frame)
                self._sent += 1
            while self._socket.poll():
                self._waiting.append(self._socket.recv())
                self._taken += 1
            while self._waiting and node.waiting < QUEUE:
                node.send(self._waiting.popleft())
            self._wakes += 1
            if self._wakes % REPORT == 0:
                self._socket.send(Report(cycle, len(self._waiting)))
        except (EOFError, OSError):
            self.finished = True

    def conclusion(self) -> object:
        """Frames from the chip and to it."""
        return {"from_chip": self._sent, "to_chip": self._taken - len(self._waiting)}


class CanLink:
    """Our end: `send` from any thread; `received` is called with each frame of the chip's bus, in a thread."""

    def __init__(self, received: Callable[[Frame], None]) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="fluxlock-can-")
        self.address = str(Path(self._folder.name) / "link")
        self._listener = Listener(self.address, "AF_UNIX")
        self._received = received
        self._socket: Connection | None = None
        self._joined = threading.Event()
        self._sending = threading.Lock()
        self.report = Report(0, 0)
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def wait(self, seconds: float) -> bool:
        """Until the simulator has joined the bus; False: it has not."""
        return self._joined.wait(seconds)

    def send(self, frame: Frame) -> bool:
        """A frame for the chip's bus; False: the simulator has not joined or has ended."""
        if self._socket is None:
            return False
        try:
            with self._sending:
                self._socket.send(frame)
        except OSError:
            return False
        return True

    def close(self) -> None:
        """Leave: the simulator ends its run at its next wake-up."""
        # The thread closes what it reads from: here it only comes to its end.
        if self._socket is None:
            with contextlib.suppress(OSError):
                Client(self.address, "AF_UNIX").close()
        else:
            with contextlib.suppress(OSError), socket.socket(fileno=os.dup(self._socket.fileno())) as same:
                same.shutdown(socket.SHUT_RDWR)
        if threading.current_thread() is not self._thread:
            self._thread.join()

    def _serve(self) -> None:
        try:
            self._socket = self._listener.accept()
            self._joined.set()
            while True:
                item = self._socket.recv()
                if isinstance(item, Report):
                    self.report = item
                else:
                    self._received(item)
        except (EOFError, OSError):
            pass
        finally:
            if self._socket is not None:
                self._socket.close()
            self._listener.close()
            self._folder.cleanup()
