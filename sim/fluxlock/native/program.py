# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The command `fluxlock native`: the firmware on a bus and a console until it is told to end."""

from __future__ import annotations

import os
import select
import sys
import time
from pathlib import Path

from fluxlock.base.writable import check_file
from fluxlock.can.can_bus import open_bus
from fluxlock.config import ConfigError, Problem, Scenario
from fluxlock.native.drive import NativeDrive, drive_of_scenario
from fluxlock.native.recorder import Recorder
from fluxlock.native.serve import serve
from fluxlock.results.metrics import Analysis
from fluxlock.results.verdict import Verdict, judge_run, say


class Terminal:
    """The drive's console on stdin and stdout."""

    def __init__(self, drive: NativeDrive, recorder: Recorder) -> None:
        self._drive, self._recorder, self._text, self._open = drive, recorder, "", True

    def poll(self) -> None:
        """Lines that have come, and the drive's replies."""
        while self._open and select.select([sys.stdin], [], [], 0)[0]:
            data = os.read(sys.stdin.fileno(), 4096)
            self._open = bool(data)
            self._text += data.decode("ascii", errors="replace")
            *lines, self._text = self._text.split("\n")
            for line in lines:
                replies = self._drive.chip.fw.command(line.strip())
                self._recorder.answered(line.strip(), replies)
                for reply in replies:
                    print(reply, flush=True)


class MemoryFile:
    """The drive's non-volatile memory in a file, written whenever it changes."""

    def __init__(self, path: Path, drive: NativeDrive) -> None:
        self._path, self._node = path, drive.node
        if path.is_dir():
            raise ConfigError([Problem("--memory", str(path), "is a folder; name a file")])
        check_file(path)
        if path.exists():
            data = path.read_bytes()
            if len(data) != len(self._node.memory):
                text = f"is no memory of this drive: {len(data)} bytes, not {len(self._node.memory)}; name another file"
                raise ConfigError([Problem("--memory", str(path), text)])
            self._node.memory = data
            self._node.boot()
            if self._node.value("error_register"):
                code = self._node.value("error_field_error_1")
                text = (
                    f"warning: {path}: what is stored has an error (EMCY 0x{code:04X}): docs/canopen.md#stored-objects"
                )
                print(text, file=sys.stderr, flush=True)
        self._kept = b""
        self.keep()

    def keep(self) -> None:
        """Write what has changed; a program that is killed meanwhile leaves the file before it."""
        if self._node.memory == self._kept:
            return
        self._kept = self._node.memory
        partial = self._path.with_name(f"{self._path.name}.part")
        with partial.open("wb") as out:
            out.write(self._kept)
            out.flush()
            os.fsync(out.fileno())
        partial.replace(self._path)


def run_native(
    scenario: Scenario,
    bus_name: str,
    node_id: int,
    speed: float | None = 1.0,
    seconds: float | None = None,
    memory: Path | None = None,
) -> bool:
    """Run for a simulated time, or until Ctrl-C; says at the end what to think of it, and how fast it was.

    speed: None: as fast as it goes. False: the run cannot be vouched for.
    """
    print("compiling what has changed", file=sys.stderr, flush=True)
    drive = drive_of_scenario(scenario, node_id)
    recorder = Recorder(drive)
    terminal = Terminal(drive, recorder)
    file = MemoryFile(memory, drive) if memory is not None else None

    def stop() -> bool:
        recorder.note()
        terminal.poll()
        return seconds is not None and drive.now_us >= 1e6 * seconds

    with open_bus(bus_name) as bus:
        print(f"node {node_id} on {bus_name}, process {os.getpid()}", flush=True)
        begin = time.monotonic()
        try:
            serve(drive, bus, stop, speed, file.keep if file is not None else None)
        finally:
            verdict = verdict_of(recorder, scenario)
            say(verdict)
            print(f"{drive.now_us / 1e6:.3f} s simulated in {time.monotonic() - begin:.3f} s", flush=True)
    return verdict.passed


def verdict_of(recorder: Recorder, scenario: Scenario) -> Verdict:
    """Of a drive that is commanded from outside: the scenario's events, windows and limits do not count."""
    data = recorder.data()
    if data.records.size < 2:
        return Verdict(True, ["the run was too short to judge"])
    bare = scenario.model_copy(update={"event": [], "window": [], "expect": []})
    return judge_run(data, bare, Analysis(data), {}, by_bus=True)
