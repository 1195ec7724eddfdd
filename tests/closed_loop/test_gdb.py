# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""GDB itself on the simulated core: the session of the page, Ctrl-C, detach, kill, refusals, and the same trace."""

from __future__ import annotations

import re
import shlex
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np

from fluxlock.base.paths import BUILD, ROOT
from fluxlock.cosim.debugger import NAMES
from fluxlock.results.rundata import LogKind, load_trace

PAGE = ROOT / "docs" / "howto" / "firmware" / "debug-the-chip.md"
START = re.compile(r"^\.venv/bin/(fluxlock run .*) --gdb :3333$", re.MULTILINE)
SESSION = re.compile(r"^\(gdb\) target remote.*?(?=^```)", re.DOTALL | re.MULTILINE)
PROMPT, END = "(gdb) ", "end of the answer"
ANY = "...\n"  # the page shows no answer
CLOCK = re.compile(r"^clock (\d+), ", re.MULTILINE)
INTERRUPTS = 20  # one may reach GDB in front of its `continue`


class Gdb:
    """GDB of the lock file, command by command."""

    def __init__(self, elf: str) -> None:
        command = [str(Path(sys.executable).with_name("gdb")), "-nx", "-q", "-ex", "set prompt"]
        for setting in ("width 0", "pagination off", "confirm off"):
            command += ["-ex", f"set {setting}"]
        self._gdb = subprocess.Popen(
            [*command, elf], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        )
        self.ask("show version")

    def send(self, command: str) -> None:
        assert self._gdb.stdin is not None
        print(f"{PROMPT}{command}")
        self._gdb.stdin.write(f"{command}\necho {END}\\n\n")
        self._gdb.stdin.flush()

    def answer(self) -> str:
        """What GDB prints until the end of the answer."""
        assert self._gdb.stdout is not None
        lines: list[str] = []
        for line in self._gdb.stdout:
            if END in line:
                lines.append(line.partition(END)[0])
                break
            lines.append(line)
        else:
            raise AssertionError(f"GDB has ended: {''.join(lines)}")
        print("".join(lines), end="")
        return "".join(lines)

    def ask(self, command: str) -> str:
        self.send(command)
        return self.answer()

    def interrupt(self) -> str:
        """`continue`, and Ctrl-C while the core runs; what GDB says."""
        for _ in range(INTERRUPTS):
            self.send("continue")
            time.sleep(0.1)
            self._gdb.send_signal(signal.SIGINT)
            said = self.answer()
            if "Program received" in said:
                return said
        raise AssertionError("no interrupt has reached the core")

    def end(self) -> None:
        assert self._gdb.stdin is not None and self._gdb.stdout is not None
        self._gdb.stdin.close()
        self._gdb.stdout.read()
        assert self._gdb.wait() == 0


def run_of_page(name: str, *more: str) -> tuple[subprocess.Popen[str], Path]:
    """The command of the page."""
    found = START.search(PAGE.read_text(encoding="utf-8"))
    assert found
    out = BUILD / "closed_loop" / name
    words = [sys.executable, "-m", *shlex.split(found[1]), "--out", str(out), *more]
    return subprocess.Popen(words, cwd=ROOT, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE), out


def session_of_page() -> list[tuple[str, str]]:
    """Commands, and what the page says that GDB prints."""
    (block,) = SESSION.findall(PAGE.read_text(encoding="utf-8"))
    parts = block.split(PROMPT)[1:]
    return [(command, answer) for command, _, answer in (part.partition("\n") for part in parts)]


def shape(text: str) -> list[str]:
    """Words of a text without its numbers, which change with the firmware."""
    return re.sub(r"0x[0-9a-f]+|-?\d+(\.\d+)?", "N", text).split()


def leave_and_return(elf: str, remote: str) -> None:
    """Registers by name, Ctrl-C, refusals, and three ways to leave with a breakpoint set."""
    gdb = Gdb(elf)
    assert "_start" in gdb.ask(remote)
    assert gdb.ask("print/x $pc") == "$1 = 0x80\n"
    names = re.findall(r"^(\w+) ", gdb.ask("info registers"), re.MULTILINE)
    assert tuple(names) == NAMES[1:]  # GDB lists no register that is always 0
    assert "SIGINT" in gdb.interrupt()
    pc = gdb.ask("print $pc")
    assert "Cannot access memory at address 0x80000000" in gdb.ask("x 0x80000000")
    assert "annot" in gdb.ask("set var app.drive.order.tick = 1") and "ould not" in gdb.ask("set var $a0 = 1")
    assert gdb.ask("print $pc").partition("=")[2] == pc.partition("=")[2]
    assert "Breakpoint" in gdb.ask("break six_step_control_step")
    assert "detached" in gdb.ask("detach")
    gdb.ask(remote)
    assert "killed" in gdb.ask("kill")
    gdb.ask(remote)
    gdb.end()


def test_the_session_of_the_page() -> None:
    """GDB prints what the page shows; it stops within a sector at 60 000 r/min; the trace is that of a run without.

    Verifies: SYS-20
    """
    plain, plain_out = run_of_page("gdb-page-without")
    said = plain.communicate()[1]
    assert plain.returncode == 0, said
    run, out = run_of_page("gdb-page", "--gdb", ":0")
    assert run.stderr is not None and run.stdout is not None
    line = next(line for line in run.stderr if line.startswith("waiting"))
    threading.Thread(target=run.stderr.read, daemon=True).start()
    found = re.fullmatch(r"waiting at \S+:(\d+); symbols: (.*)\n", line)
    assert found
    remote = f"target remote :{found[1]}"
    leave_and_return(found[2], remote)
    gdb, clocks = Gdb(found[2]), []
    for command, shown in session_of_page():
        said = gdb.ask(remote if command.startswith("target") else command)
        assert shown == ANY or shape(said) == shape(shown), f"{command}\n{said}"
        clocks += [int(clock) for clock in CLOCK.findall(said)]
    gdb.end()
    print(run.stdout.read())
    assert run.wait() == 0
    assert (out / "trace.npz").read_bytes() == (plain_out / "trace.npz").read_bytes()
    commutations = load_trace(out / "trace.npz").rows(LogKind.COMMUTATION)[:, 0]
    at = np.searchsorted(commutations, clocks)
    shares = (clocks - commutations[at - 1]) / (commutations[at] - commutations[at - 1])
    print(f"stops at these shares of their sector: {shares}")
    assert np.any((shares > 0.2) & (shares < 0.8))
