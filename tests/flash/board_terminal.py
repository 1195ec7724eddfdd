# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A board behind a pseudo-terminal: a loader with a flash, and the console of the program that it starts."""

from __future__ import annotations

import os
import pty
import select
import struct
import threading
import tty
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path

from fluxlock.flash.board_console import MARK, with_checksum
from fluxlock.flash.loader import CHECK, ERASE, HELLO, START, SYNC, WRITE, frame, unpack

Answer = Callable[[str], list[str]]  # of a console to a line
LOOK_S = 0.02


@dataclass
class BoardTerminal:
    """program: makes the console of an image with its parameter block; None: nobody has reset the board.

    spoil: of a reply, its number and bytes; the bytes that arrive. around: the thread that plays it.
    """

    program: Callable[[dict[int, bytes]], Answer] | None
    spoil: Callable[[int, bytes], bytes] = lambda count, data: data
    around: Callable[[], AbstractContextManager[None]] = nullcontext
    flash: dict[int, bytes] = field(default_factory=dict)  # pages by address
    lines: list[str] = field(default_factory=list)
    starts: int = 0

    def serve(self, host: int, over: threading.Event) -> None:
        """Answer until it is over."""
        with self.around():
            self._serve(host, over)

    def _serve(self, host: int, over: threading.Event) -> None:
        held, replies, answer = b"", 0, None
        while not over.is_set():
            if not select.select([host], [], [], LOOK_S)[0]:
                continue
            try:
                held += os.read(host, 65536)
            except OSError:
                return
            while held:
                if held[0] == SYNC:  # also to a program that runs: somebody has reset the board
                    if len(held) < 4 or len(held) < 8 + struct.unpack_from("<H", held, 2)[0]:
                        break
                    length = 8 + struct.unpack_from("<H", held, 2)[0]
                    found, held = unpack(held[1:length]), held[length:]
                    if found is not None and self.program is not None:
                        os.write(host, self._load(*found))
                        if found[0] == START:
                            answer, self.starts = self.program(self.flash), self.starts + 1
                    continue
                line, end, rest = held.partition(b"\n")
                if not end:
                    break
                held = rest
                if answer is not None and line.strip():
                    text = line.decode().strip()
                    assert text == with_checksum(text[:-MARK])
                    self.lines.append(text[:-MARK])
                    reply = "".join(f"{with_checksum(said)}\r\n" for said in answer(self.lines[-1]))
                    os.write(host, self.spoil(replies, reply.encode()))
                    replies += 1

    def _load(self, code: int, payload: bytes) -> bytes:
        if code == HELLO:
            return frame(0, struct.pack("<2I", 1, 0xEF4018))
        if code == WRITE:
            self.flash[struct.unpack_from("<I", payload)[0]] = payload[4:]
        elif code in (CHECK, START):
            return frame(0, struct.pack("<I", 0))
        else:
            assert code == ERASE
        return frame(0)


@contextmanager
def behind_a_terminal(serve: Callable[[int, threading.Event], None]) -> Iterator[Path]:
    """The serial port whose other end is served, in a thread, until an event."""
    host, end = pty.openpty()
    tty.setraw(end)
    over = threading.Event()
    thread = threading.Thread(target=serve, args=(host, over), daemon=True)
    thread.start()
    try:
        yield Path(os.ttyname(end))
    finally:
        # Before the numbers of the files are another test's.
        over.set()
        thread.join()
        os.close(end)
        os.close(host)
