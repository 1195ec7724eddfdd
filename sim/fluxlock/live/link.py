# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The page's side of a source: begins its process, keeps its newest rows, tells all viewers when it has died."""

from __future__ import annotations

import asyncio
import multiprocessing
import threading
from collections import deque
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import Any

from fluxlock.live.traces import Ring
from fluxlock.live.worker import Shown, work

SAID = 200  # newest entries of the journal that a new viewer sees
END_S = 2.0


class Link:
    """One source. tell: called in the event loop with each message for all viewers."""

    def __init__(self, shown: Shown, seed: int, factor: float, tell: Callable[[dict[str, Any]], None]) -> None:
        self._arguments, self._tell = (shown, seed, factor), tell
        self.ring = Ring()
        self.hello: dict[str, Any] | None = None
        self.status: dict[str, Any] = {}
        self.said: deque[dict[str, Any]] = deque(maxlen=SAID)
        self.died = ""  # why
        self._process: multiprocessing.process.BaseProcess | None = None

    def begin(self) -> None:
        """Start the process, in place of one that has died; needs a running event loop."""
        self.end()
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=work, args=(theirs, *self._arguments), daemon=True)
        self._process.start()
        theirs.close()
        self.died = ""
        self._loop = asyncio.get_running_loop()
        threading.Thread(target=self._listen, args=(self._pipe, self._process), daemon=True).start()

    def end(self) -> None:
        """End the process."""
        process, self._process = self._process, None
        if process is not None:
            self._pipe.close()
            process.terminate()
            process.join(END_S)

    @property
    def process_id(self) -> int | None:
        """Of the source, None without one."""
        return self._process.pid if self._process is not None else None

    def order(self, message: object) -> bool:
        """Pass a message on; False: no source is there."""
        if self._process is None or self.died:
            return False
        try:
            self._pipe.send(message)
        except OSError:
            return False
        return True

    def _listen(self, pipe: Connection, process: multiprocessing.process.BaseProcess) -> None:
        why = ""
        try:
            while True:
                message = pipe.recv()
                if message["kind"] == "died":
                    why = message["text"]
                self._loop.call_soon_threadsafe(self._receive, process, message)
        except (EOFError, OSError, TypeError):
            process.join(END_S)
            code = process.exitcode
            text = (
                why
                or f"its process ended with {f'signal {-code}' if code is not None and code < 0 else f'code {code}'}"
            )
            try:
                self._loop.call_soon_threadsafe(self._lost, process, text)
            except RuntimeError:
                return  # the server has ended

    def _receive(self, process: object, message: dict[str, Any]) -> None:
        if process is not self._process:
            return
        if message["kind"] == "rows":
            self.ring.append(message["time_s"], message["rows"])
            self.ring.mark(message["marks"])
            self.status = message["status"]
            return
        if message["kind"] == "hello":
            self.ring.clear()
            self.said.clear()
            self.hello = message
        elif message["kind"] == "said":
            self.said.append(message)
        self._tell(message)

    def _lost(self, process: object, text: str) -> None:
        if process is self._process:
            self.died = text
            self._tell({"kind": "died", "text": text})
