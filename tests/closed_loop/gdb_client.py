# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A scripted debugger: GDB's remote serial protocol from its other side, and the run that it debugs, for tests."""

from __future__ import annotations

import re
import socket
import subprocess
import threading
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from fluxlock.results.rundata import FloatArray, LogKind, load_trace


def waiting(run: subprocess.Popen[str]) -> tuple[str, int, str]:
    """Host and port at which a run waits for its debugger, and the ELF file with the symbols."""
    assert run.stderr is not None
    line = next(line for line in run.stderr if line.startswith("waiting"))
    threading.Thread(target=run.stderr.read, daemon=True).start()
    found = re.fullmatch(r"waiting at (\S+):(\d+); symbols: (.*)\n", line)
    assert found, line
    return found[1], int(found[2]), found[3]


def ends_as(run: subprocess.Popen[str], out: Path, plain_out: Path, clocks: Sequence[int]) -> FloatArray:
    """A debugged run ends with the trace of the one without; where in their sectors the stops were, 0 to 1."""
    assert run.stdout is not None
    print(run.stdout.read())
    assert run.wait() == 0
    assert (out / "trace.npz").read_bytes() == (plain_out / "trace.npz").read_bytes()
    commutations = load_trace(out / "trace.npz").rows(LogKind.COMMUTATION)[:, 0]
    at = np.searchsorted(commutations, clocks)
    shares: FloatArray = (clocks - commutations[at - 1]) / (commutations[at] - commutations[at - 1])
    print(f"stops at these shares of their sector: {shares}")
    return shares


class Refused(Exception):
    """The server's error."""


class GdbClient:
    """Packets to and from a server. Stops are the server's words: `T05thread:1;`."""

    def __init__(self, host: str, port: int) -> None:
        self._link = socket.create_connection((host, port))
        self._heard = b""

    def __enter__(self) -> GdbClient:
        return self

    def __exit__(self, *_: object) -> None:
        self._link.close()

    def send(self, text: str) -> None:
        body = text.encode()
        self._link.sendall(b"$%s#%02x" % (body, sum(body) % 256))

    def receive(self) -> str:
        """The next packet, acknowledged."""
        while True:
            begin, end = self._heard.find(b"$"), self._heard.find(b"#")
            if 0 <= begin < end and len(self._heard) >= end + 3:
                body, check = self._heard[begin + 1 : end], self._heard[end + 1 : end + 3]
                assert sum(body) % 256 == int(check, 16)
                self._heard = self._heard[end + 3 :]
                self._link.sendall(b"+")
                return body.decode()
            more = self._link.recv(4096)
            if not more:
                raise ConnectionError("the server has closed")
            self._heard += more

    def ask(self, text: str) -> str:
        self.send(text)
        answer = self.receive()
        if answer.startswith("E"):
            raise Refused(answer)
        return answer

    def interrupt(self) -> None:
        self._link.sendall(b"\x03")

    def registers(self) -> list[int]:
        """x0 to x31, pc."""
        data = bytes.fromhex(self.ask("g"))
        return [int.from_bytes(data[4 * n : 4 * n + 4], "little") for n in range(33)]

    def memory(self, address: int, count: int) -> bytes:
        return bytes.fromhex(self.ask(f"m{address:x},{count:x}"))

    def step(self) -> str:
        return self.ask("s")

    def go(self) -> str:
        return self.ask("c")
