# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""GDB itself on the simulated core: the session of the page, Ctrl-C, detach, kill, refusals, and the same trace."""

from __future__ import annotations

import queue
import re
import shlex
import signal
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np

from fluxlock.base.paths import BUILD, ROOT
from fluxlock.cosim.debugger import NAMES
from tests.closed_loop.gdb_client import ends_as, waiting

PAGE = ROOT / "docs" / "howto" / "firmware" / "debug-the-chip.md"
START = re.compile(r"^\.venv/bin/(fluxlock run .*) --gdb :3333$", re.MULTILINE)
SESSION = re.compile(r"^\(gdb\) target remote.*?(?=^```)", re.DOTALL | re.MULTILINE)
PROMPT, END = "(gdb) ", "end of the answer"
ANY = "...\n"  # the page shows no answer
WAITS = "[infrun] fetch_inferior_event: exit\n"
CLOCK = re.compile(r"^clock (\d+), ", re.MULTILINE)


class Gdb:
    """GDB of the lock file, command by command."""

    def __init__(self, elf: str) -> None:
        command = [str(Path(sys.executable).with_name("gdb")), "-nx", "-q", "-ex", "set prompt"]
        for setting in ("width 0", "pagination off", "confirm off"):
            command += ["-ex", f"set {setting}"]
        self._gdb = subprocess.Popen(
            [*command, elf], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        )
        self._lines: queue.Queue[str] = queue.Queue()
        threading.Thread(target=self._listen, daemon=True).start()
        self.ask("show version")

    def _listen(self) -> None:
        assert self._gdb.stdout is not None
        for line in self._gdb.stdout:
            print(line, end="")
            self._lines.put(line)
        self._lines.put("")

    def _write(self, command: str) -> None:
        assert self._gdb.stdin is not None
        self._gdb.stdin.write(f"{command}\n")
        self._gdb.stdin.flush()

    def ask(self, command: str) -> str:
        """What GDB prints until the end of the answer."""
        print(f"{PROMPT}{command}")
        self._write(f"{command}\necho {END}\\n")
        lines: list[str] = []
        while not lines or END not in lines[-1]:
            lines.append(self._lines.get())
            assert lines[-1], "GDB has ended"
        return "".join(lines).partition(END)[0]

    def interrupt(self) -> str:
        """`continue`, and one Ctrl-C once GDB waits: one before is lost, a second makes it give up. What it says."""
        self.ask("set debug infrun on")  # GDB's log says when it waits
        self._write("continue")
        self._until(WAITS)
        self._gdb.send_signal(signal.SIGINT)
        return self._until("Program received") + self.ask("set debug infrun off")

    def _until(self, part: str) -> str:
        """The line that has it."""
        said = ""
        while part not in said:
            said = self._lines.get()
            assert said and "exited" not in said, "no interrupt has reached the core"
        return said

    def end(self) -> None:
        assert self._gdb.stdin is not None
        self._gdb.stdin.close()
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
    _, port, elf = waiting(run)
    remote = f"target remote :{port}"
    leave_and_return(elf, remote)
    gdb, clocks = Gdb(elf), []
    for command, shown in session_of_page():
        said = gdb.ask(remote if command.startswith("target") else command)
        assert shown == ANY or shape(said) == shape(shown), f"{command}\n{said}"
        clocks += [int(clock) for clock in CLOCK.findall(said)]
    gdb.end()
    shares = ends_as(run, out, plain_out, clocks)
    assert np.any((shares > 0.1) & (shares < 0.9))
