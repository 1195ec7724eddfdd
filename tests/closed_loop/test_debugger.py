# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""`fluxlock run --gdb`: a scripted debugger stops core and motor, looks, steps, watches, and changes nothing.

The debugger is `gdb_client`: it sees what a packet carries. GDB itself is in `test_gdb`.
"""

from __future__ import annotations

import socket
import struct
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fluxlock.base.paths import BUILD
from fluxlock.config import ConfigError
from fluxlock.cosim.branches import STATE_ADDRESS
from fluxlock.cosim.debugger import Debugger, open_port
from fluxlock.generate.memory import TELEMETRY_ADDRESS
from fluxlock.generate.registers import IO_BASE
from fluxlock.profile.elf import Program, read_program
from fluxlock.results.rundata import SimulationFault
from tests.closed_loop.gdb_client import GdbClient, Refused, ends_as, waiting

SPIN = Path(__file__).parent / "scenarios" / "spin.toml"
RPM = 60_000
RUNNING = 3  # STATE_RUNNING
SPEED_ADDRESS = TELEMETRY_ADDRESS + 4 * 8  # telemetry.h: r/min, q8
FROM_S = 0.03
STEPS, TICKS = 100, 5
EVENTS = f'event=[{{at_s=0.003,speed_rpm={RPM}}},{{at_s=0.004,command="start"}}]'
OPTIONS = ("duration_s=0.04", f"initial.speed_rpm={RPM}", "window=[]", "expect=[]", EVENTS)
WORD = 0xFFFFFFFF


def start(name: str, *options: str) -> tuple[subprocess.Popen[str], Path]:
    out = BUILD / "closed_loop" / name
    command = [sys.executable, "-m", "fluxlock", "run", str(SPIN), "--out", str(out), *options]
    for option in OPTIONS:
        command += ["--set", option]
    return subprocess.Popen(command, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE), out


def signed(value: int, bits: int) -> int:
    return (value & (1 << bits) - 1) - ((value & 1 << bits - 1) << 1)


def check_step(gdb: GdbClient, program: Program, x: list[int]) -> list[int]:
    """One instruction: what it did to registers, memory and place, by the architecture; the registers after it."""
    pc = x[32]
    code = int(program.code[pc // 4])
    opcode, rd, f3, rs1, rs2, f7 = (
        code & 127,
        code >> 7 & 31,
        code >> 12 & 7,
        code >> 15 & 31,
        code >> 20 & 31,
        code >> 25,
    )
    i_offset, s_offset = signed(code >> 20, 12), signed(code >> 25 << 5 | rd, 12)
    wanted: int | None = None
    if opcode == 0x03 and f3 == 2 and x[rs1] + i_offset & WORD < IO_BASE:
        wanted = int.from_bytes(gdb.memory(x[rs1] + i_offset & WORD, 4), "little")
    elif opcode == 0x13 and f3 == 0:
        wanted = x[rs1] + i_offset
    elif opcode == 0x33 and f3 == 0 and f7 in (0, 1, 32):
        wanted = {0: x[rs1] + x[rs2], 1: x[rs1] * x[rs2], 32: x[rs1] - x[rs2]}[f7]
    elif opcode in (0x37, 0x17):
        wanted = (code & 0xFFFFF000) + (pc if opcode == 0x17 else 0)
    elif opcode in (0x6F, 0x67):
        wanted = pc + 4
    assert gdb.step() == "T05thread:1;"
    after = gdb.registers()
    if wanted is not None and rd:
        assert after[rd] == wanted & WORD, (hex(pc), hex(code))
    if opcode == 0x23 and x[rs1] + s_offset & WORD < IO_BASE:
        count = 1 << f3
        assert gdb.memory(x[rs1] + s_offset & WORD, count) == x[rs2].to_bytes(4, "little")[:count], hex(pc)
    if opcode not in (0x63, 0x67, 0x6F, 0x73):
        assert after[32] in (pc + 4, program.symbols["trap_entry"])
    unchanged = [n for n in range(32) if n != rd or opcode in (0x23, 0x63)]
    assert after[32] == program.symbols["trap_entry"] or [after[n] for n in unchanged] == [x[n] for n in unchanged]
    return after


def clock_of(gdb: GdbClient) -> int:
    """Clock at which the core stands, by the monitor's command."""
    return int(bytes.fromhex(gdb.ask("qRcmd,636c6f636b")).decode().split()[1].rstrip(","))


def session(gdb: GdbClient, program: Program) -> list[int]:
    """Stops in the control step of a motor that turns at its speed; the clocks of the stops."""
    step = program.symbols["six_step_control_step"]
    assert gdb.registers()[32] == 0x80 and gdb.ask("?") == "T02thread:1;"
    for packet in ("G" + 33 * "00000000", "P1=00000000", "M1f000,4:00000000", f"m{IO_BASE:x},4", "cffff", "mxyz,4"):
        with pytest.raises(Refused):
            gdb.ask(packet)
    assert gdb.ask(f"Z0,{step:x},4") == "OK"
    clock, clocks = 0, []
    while clock < FROM_S * 50e6:
        assert gdb.go() == "T05thread:1;" and gdb.registers()[32] == step
        clock = clock_of(gdb)
    for _ in range(TICKS):
        assert gdb.memory(STATE_ADDRESS, 1)[0] == RUNNING
        speed = int.from_bytes(gdb.memory(SPEED_ADDRESS, 4), "little") / 256
        assert speed == pytest.approx(RPM, rel=0.02)
        clocks.append(clock_of(gdb))
        x = gdb.registers()
        for _ in range(STEPS):
            x = check_step(gdb, program, x)
        assert gdb.go() == "T05thread:1;"
    gdb.ask(f"z0,{step:x},4")
    assert gdb.ask(f"Z2,{SPEED_ADDRESS:x},4") == "OK"
    assert gdb.go() == f"T05watch:{SPEED_ADDRESS:x};thread:1;"
    store = int(program.code[gdb.registers()[32] // 4 - 1])
    value = gdb.registers()[store >> 20 & 31]
    assert store & 127 == 0x23 and int.from_bytes(gdb.memory(SPEED_ADDRESS, 4), "little") == value
    gdb.ask(f"z2,{SPEED_ADDRESS:x},4")
    gdb.send("c")
    time.sleep(0.1)
    gdb.interrupt()
    stopped = gdb.receive()
    assert stopped in ("T02thread:1;", "W00")
    assert stopped == "W00" or gdb.go() == "W00"
    return clocks


def test_a_run_in_the_debugger_is_the_run_without() -> None:
    """Stops at 60 000 r/min, some in the middle of a sector; single steps as the architecture has them; same trace.

    Verifies: SYS-20
    """
    plain, plain_out = start("gdb-without")
    text = plain.communicate()[1]
    assert plain.returncode == 0, text
    run, out = start("gdb-with", "--gdb", ":0")
    host, port, elf = waiting(run)
    with GdbClient(host, port) as gdb:
        clocks = session(gdb, read_program(Path(elf)))
    shares = ends_as(run, out, plain_out, clocks)
    assert np.any((shares > 0.25) & (shares < 0.75))


@pytest.mark.parametrize("text", ["3333", ":port", ":70000", "no.such.host.invalid:1"])
def test_a_wrong_port(text: str) -> None:
    """One line says what a port looks like, or why it cannot be opened.

    Verifies: SYS-20
    """
    with pytest.raises(ConfigError, match=r"must be \[HOST\]:PORT|cannot be opened"):
        open_port(text)


class StandIn:
    """A core whose program counter counts."""

    def __init__(self) -> None:
        self.stop: Any = type(
            "Stop", (), {"pc": 0x80, "x": [0] * 32, "cycle": 0, "reason": 1, "touched": 0, "kinds": 0}
        )()
        self.points: list[tuple[int, ...]] = []
        self.steps: list[int] = []

    def debug(self, on_stop: Any) -> None:
        self.stopped = on_stop

    def leave(self) -> None:
        pass

    def set_break(self, address: int, on: bool) -> None:
        self.points.append((address, on))

    def set_watch(self, address: int, size: int, kinds: int, on: bool) -> None:
        self.points.append((address, size, kinds, on))

    def resume(self, steps: int = 0) -> None:
        self.steps.append(steps)

    def request(self) -> None:
        self.steps.append(-1)

    def read(self, address: int, count: int) -> bytes | None:
        return bytes(count) if address < 0x20000 else None


def test_a_debugger_that_leaves_takes_its_points_with_it() -> None:
    """Its breakpoints are gone, the core goes on, the next debugger is served.

    Verifies: SYS-20
    """
    core, listener = StandIn(), open_port(":0")
    host, port = listener.getsockname()
    server = Debugger(core, listener, 50e6)
    for _ in range(2):
        core.points.clear()
        thread = threading.Thread(target=core.stopped)
        thread.start()
        with GdbClient(host, port) as gdb:
            assert gdb.ask("?") == "T02thread:1;"
            assert gdb.ask("Z0,100,4") == gdb.ask("Z4,200,2") == "OK"
            gdb.ask("D")
        thread.join(10)
        assert not thread.is_alive()
        assert sorted(core.points) == [(0x100, False), (0x100, True), (0x200, 2, 3, False), (0x200, 2, 3, True)]
    server.end()


def test_what_is_no_debugger_ends_nothing() -> None:
    """A broken check, a packet without an end, more memory than a packet holds, an interrupt: all told, none fatal.

    Verifies: SYS-20
    """
    core, listener = StandIn(), open_port(":0")
    server = Debugger(core, listener, 50e6)
    thread = threading.Thread(target=core.stopped)
    thread.start()
    with socket.create_connection(listener.getsockname(), 10) as link:
        link.settimeout(10)
        link.sendall(b"#00noise$?#zz")
        assert link.recv(1) == b"-"
        link.sendall(b"$m0,ffffffff#%02x" % (sum(b"m0,ffffffff") % 256))
        answer = b""
        while not answer.endswith(b"#aa"):
            answer += link.recv(1)
        assert answer == b"+$E14#aa"
        link.sendall(b"$c#63\x03")
        thread.join(10)
        assert not thread.is_alive()
        server.listen()
        assert -1 in core.steps, "an interrupt that comes with the packet before it"
        core.steps.clear()
        link.sendall(b"\x03")
        while -1 not in core.steps:
            server.listen()
        thread = threading.Thread(target=core.stopped)
        thread.start()
        link.sendall(b"$" + bytes(20_000))
        thread.join(10)
        assert not thread.is_alive()
    server.end()


def test_a_debugger_that_is_killed_while_the_core_runs() -> None:
    """Its connection is reset, not closed: the run goes on, the next debugger is served.

    Verifies: SYS-20
    """
    core, listener = StandIn(), open_port(":0")
    host, port = listener.getsockname()
    server = Debugger(core, listener, 50e6)
    thread = threading.Thread(target=core.stopped)
    thread.start()
    with socket.create_connection((host, port), 10) as link:
        link.sendall(b"$c#63")
        thread.join(10)
        link.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))  # close resets
    server.listen()
    thread = threading.Thread(target=core.stopped)
    thread.start()
    with GdbClient(host, port) as gdb:
        assert gdb.ask("?") == "T02thread:1;"
    thread.join(10)
    assert not thread.is_alive()
    server.end()


def test_two_runs_with_one_port() -> None:
    """Both find it free while their chips are built; the later one says that it is taken.

    Verifies: SYS-20
    """
    first = open_port(":0")
    port = first.getsockname()[1]
    second = open_port(f":{port}")
    server = Debugger(StandIn(), first, 50e6)
    with pytest.raises(SimulationFault, match=f"--gdb: 127.0.0.1:{port}: cannot be opened: .*; take another port"):
        Debugger(StandIn(), second, 50e6)
    server.end()
    second.close()
