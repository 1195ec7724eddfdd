# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""GDB's remote serial protocol for the soft core of the simulated chip, in the simulator's process.

The simulator's main compares addresses for breakpoints and watchpoints (`core_probe.h`). It writes nothing into the
chip's memory. While the core stands, the whole simulation stands: chip, motor and time. So a run with a debugger is the
same run as one without, bit for bit. For the same reason the server refuses to write registers and memory. It also
refuses to read the chip's registers: that has side effects and takes clocks of the bus.
"""

from __future__ import annotations

import select
import socket
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from fluxlock.headers import CData
from fluxlock.results.rundata import SimulationFault

OPTION = "--gdb"
CORE_HALT, CORE_WATCH = 1, 4  # of cosim.h
SIGINT, SIGTRAP = 2, 5
PC = 32  # number of this register to a debugger
PACKET_BYTES = 4096
LOOK_S = 0.05
INTERRUPT = b"\x03"
REFUSED, NO_MEMORY = "E01", "E14"
# Z packets: kinds of access, and what a stop is called.
WATCHES = {2: (2, "watch"), 3: (1, "rwatch"), 4: (3, "awatch")}
NAMES = (
    *("zero", "ra", "sp", "gp", "tp", *(f"t{n}" for n in range(3)), "fp", "s1", *(f"a{n}" for n in range(8))),
    *(*(f"s{n}" for n in range(2, 12)), *(f"t{n}" for n in range(3, 7)), "pc"),
)
TYPES = {"ra": "code_ptr", "sp": "data_ptr", "gp": "data_ptr", "fp": "data_ptr", "pc": "code_ptr"}
TARGET = "".join(
    [
        '<?xml version="1.0"?><!DOCTYPE target SYSTEM "gdb-target.dtd"><target version="1.0">',
        '<architecture>riscv:rv32</architecture><feature name="org.gnu.gdb.riscv.cpu">',
        *(f'<reg name="{n}" bitsize="32" type="{TYPES.get(n, "int")}" regnum="{k}"/>' for k, n in enumerate(NAMES)),
        "</feature></target>",
    ]
)


class WatchedCore(Protocol):
    """What the server asks of the core (`fluxlock.cosim.native.Core`)."""

    stop: CData

    def debug(self, on_stop: Callable[[], None]) -> None:
        """Call a function at every stop."""
        ...

    def leave(self) -> None:
        """No more stops."""
        ...

    def set_break(self, address: int, on: bool) -> None:
        """Stop in front of an instruction."""
        ...

    def set_watch(self, address: int, size: int, kinds: int, on: bool) -> None:
        """Stop behind an access."""
        ...

    def resume(self, steps: int = 0) -> None:
        """Instructions until the next stop."""
        ...

    def request(self) -> None:
        """Stop at once."""
        ...

    def read(self, address: int, count: int) -> bytes | None:
        """Memory."""
        ...


@dataclass(frozen=True)
class GdbServer:
    """Socket at which the core waits for a debugger; ready: called with the image's ELF file when it does.

    The socket listens from then on, that is once the simulator has started: debuggers give up soon.
    """

    listener: socket.socket
    ready: Callable[[Path], None]

    def announce(self, elf: Path) -> None:
        """Call `ready` in time, from a thread of its own."""

        def wait() -> None:
            with suppress(OSError):  # closed: the simulator did not start
                while not self.listener.getsockopt(socket.SOL_SOCKET, socket.SO_ACCEPTCONN):
                    time.sleep(LOOK_S)
                self.ready(elf)

        threading.Thread(target=wait, daemon=True).start()


def gdb_server(text: str) -> GdbServer:
    """What `--gdb` asks for; says on the terminal when the core waits, and how to come to it."""
    listener = open_port(text)
    host, port = listener.getsockname()[:2]

    def ready(elf: Path) -> None:
        print(f"waiting at {host}:{port}; symbols: {elf}", file=sys.stderr, flush=True)

    return GdbServer(listener, ready)


def open_port(text: str) -> socket.socket:
    """The socket of `--gdb [HOST]:PORT`, which does not listen yet; port 0: a free one."""
    from fluxlock.config import ConfigError, Problem  # slow to load, and the simulator has no use for it

    host, colon, port = text.rpartition(":")
    if not colon or not (port.isascii() and port.isdigit()) or int(port) > 65535:
        raise ConfigError([Problem(OPTION, text, "must be [HOST]:PORT, for instance :3333")])
    try:
        found = socket.socket()
        found.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        found.bind((host or "127.0.0.1", int(port)))
        return found
    except OSError as error:
        raise ConfigError([Problem(OPTION, text, f"cannot be opened: {error.strerror}; take another port")]) from None


class Detached(Exception):
    """The debugger is gone."""


class Debugger:
    """Serves one debugger at a time. The run waits for the first one in front of its first instruction."""

    def __init__(self, core: WatchedCore, listener: socket.socket, clock_hz: float) -> None:
        self._core, self._listener, self._clock_hz = core, listener, clock_hz
        self._link: socket.socket | None = None
        self._heard = b""
        self._acknowledges = True
        self._set: set[tuple[int, int, int]] = set()  # kind, address, size of break- and watchpoints
        self._running = False
        core.debug(self._stopped)
        try:
            listener.listen(1)
        except OSError as error:  # another run has begun to listen since `open_port`
            host, port = listener.getsockname()[:2]
            text = f"{OPTION}: {host}:{port}: cannot be opened: {error.strerror}; take another port"
            raise SimulationFault(text) from None

    def listen(self) -> None:
        """Take an interrupt of the debugger, or a new debugger. To be called now and then while the core runs."""
        source = self._link or self._listener
        if INTERRUPT in self._heard:  # it came together with the packet that let the core go on
            self._heard = b""
            self._core.request()
            return
        if not select.select([source], [], [], 0)[0]:
            return
        if self._link is None:
            self._core.request()
            return
        try:
            heard = self._link.recv(PACKET_BYTES)
        except OSError:  # it was killed
            heard = b""
        if not heard:
            self._detach()
        elif INTERRUPT in heard:
            self._core.request()

    def end(self) -> None:
        """Say that the program has ended, and close."""
        if self._link is not None:
            with suppress(OSError):
                self._send("W00")
        self._core.leave()
        self._detach()
        self._listener.close()

    def _stopped(self) -> None:
        """Converse until the debugger lets the core go on."""
        try:
            if self._link is None:
                self._link, _ = self._listener.accept()
                self._link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                self._acknowledges = True
            else:
                self._send(self._reason())
            self._running = False
            while not self._running:
                packet = self._packet()
                try:
                    answer = self._answer(packet)
                except (ValueError, OverflowError):  # no numbers, or beyond 32 bits
                    answer = REFUSED
                if not self._running:
                    self._send(answer)
        except (Detached, OSError):
            self._detach()

    def _detach(self) -> None:
        """Let the run go on without this debugger and its break- and watchpoints."""
        for kind, address, size in self._set:
            self._put(kind, address, size, on=False)
        self._set.clear()
        if self._link is not None:
            self._link.close()
        self._link, self._heard = None, b""

    # Packets

    def _packet(self) -> str:
        """The next one, acknowledged; an interrupt while the core stands means nothing."""
        while True:
            begin = self._heard.find(b"$")
            self._heard = self._heard[begin:] if begin >= 0 else b""
            end = self._heard.find(b"#")
            if end >= 0 and len(self._heard) >= end + 3:
                body, check = self._heard[1:end], self._heard[end + 1 : end + 3]
                self._heard = self._heard[end + 3 :]
                good = check.lower() == b"%02x" % (sum(body) % 256)
                if self._acknowledges:
                    self._write(b"+" if good else b"-")
                if good:
                    return body.decode("latin-1")
                continue
            more = self._link.recv(PACKET_BYTES) if self._link is not None else b""
            if not more or len(self._heard) > 2 * PACKET_BYTES:  # gone, or no debugger
                raise Detached
            self._heard += more

    def _send(self, text: str) -> None:
        body = text.encode("latin-1")
        self._write(b"$%s#%02x" % (body, sum(body) % 256))

    def _write(self, data: bytes) -> None:
        if self._link is not None:
            self._link.sendall(data)

    # Answers

    def _answer(self, packet: str) -> str:
        """To a packet; empty: the protocol's word for one that is not known. Sets `_running` to let the core go."""
        kind, rest = packet[:1], packet[1:]
        if packet in ALWAYS:
            return ALWAYS[packet]
        if kind == "?":
            return self._reason()
        if kind == "g":
            return "".join(map(self._register, range(PC + 1)))
        if kind == "p":
            number = int(rest, 16)
            return self._register(number) if number <= PC else REFUSED
        if kind in "GPMX":
            return REFUSED
        if kind == "m":
            address, count = (int(x, 16) for x in rest.split(","))
            found = self._core.read(address, count) if count <= PACKET_BYTES else None
            return NO_MEMORY if found is None else found.hex()
        if kind in "zZ":
            return self._point(kind == "Z", rest)
        if kind in "csCS" or packet.startswith("vCont;"):
            return self._go(packet)
        if kind in "HT":
            return "OK"
        if kind in "Dk":
            if kind == "D":
                self._send("OK")
            raise Detached
        return self._query(packet)

    def _query(self, packet: str) -> str:
        if packet.startswith("qSupported"):
            return f"PacketSize={PACKET_BYTES:x};qXfer:features:read+;QStartNoAckMode+;vContSupported+"
        if packet == "QStartNoAckMode":
            self._send("OK")
            self._acknowledges = False
            return self._answer(self._packet())
        if packet.startswith("qXfer:features:read:target.xml:"):
            begin, count = (int(x, 16) for x in packet.rpartition(":")[2].split(","))
            part = TARGET[begin : begin + count]
            return ("m" if begin + count < len(TARGET) else "l") + part
        if packet.startswith("qRcmd,"):
            asked = bytes.fromhex(packet.removeprefix("qRcmd,")).decode("ascii", errors="replace").strip()
            stop = self._core.stop
            text = f"clock {stop.cycle}, {stop.cycle / self._clock_hz:.9f} s\n"
            if asked != "clock":
                text = f"there is no monitor {asked or 'without a word'}; there is: monitor clock\n"
            return text.encode().hex()
        return ""

    def _register(self, number: int) -> str:
        stop = self._core.stop
        return int(stop.pc if number == PC else stop.x[number]).to_bytes(4, "little").hex()

    def _reason(self) -> str:
        """Why the core stands."""
        stop = self._core.stop
        if stop.reason == CORE_WATCH:
            name = next(name for kinds, name in WATCHES.values() if kinds == stop.kinds)
            return f"T{SIGTRAP:02x}{name}:{stop.touched:x};thread:1;"
        return f"T{SIGINT if stop.reason == CORE_HALT else SIGTRAP:02x}thread:1;"

    def _point(self, on: bool, rest: str) -> str:
        kind, address, size = (int(x, 16) for x in rest.split(";")[0].split(","))
        if kind > max(WATCHES):
            return ""
        point = (kind, address, size)
        if on == (point in self._set):
            return "OK"
        self._put(*point, on)
        if on:
            self._set.add(point)
        else:
            self._set.remove(point)
        return "OK"

    def _put(self, kind: int, address: int, size: int, on: bool) -> None:
        if kind in WATCHES:
            self._core.set_watch(address, size, WATCHES[kind][0], on)
        else:
            self._core.set_break(address, on)

    def _go(self, packet: str) -> str:
        """Continue or step; from another place than where the core stands is refused."""
        action = packet.removeprefix("vCont;").split(";")[0].split(":")[0]
        if action[:1] in "cs" and len(action) > 1:
            return REFUSED
        self._core.resume(1 if action[:1] in "sS" else 0)
        self._running = True
        return ""


# Packets with one answer whatever the core does. There is one thread.
ALWAYS = {
    "vCont?": "vCont;c;C;s;S",
    "qC": "QC1",
    "qfThreadInfo": "m1",
    "qsThreadInfo": "l",
    "qAttached": "1",
    "qSymbol::": "OK",
}
