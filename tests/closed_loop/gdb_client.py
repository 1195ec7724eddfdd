# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A scripted debugger: GDB's remote serial protocol from its other side, for tests."""

from __future__ import annotations

import socket


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
