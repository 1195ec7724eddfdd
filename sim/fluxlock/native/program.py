"""The command `fluxlock native`: the firmware on a bus and a console until it is told to end."""

from __future__ import annotations

import os
import select
import sys
import time

from fluxlock.config import Scenario
from fluxlock.native.can_bus import open_bus
from fluxlock.native.drive import NativeDrive, drive_of_scenario
from fluxlock.native.serve import serve


class Terminal:
    """The drive's console on stdin and stdout."""

    def __init__(self, drive: NativeDrive) -> None:
        self._drive, self._text, self._open = drive, "", True

    def poll(self) -> None:
        """Lines that have come, and the drive's replies."""
        while self._open and select.select([sys.stdin], [], [], 0)[0]:
            data = os.read(sys.stdin.fileno(), 4096)
            self._open = bool(data)
            self._text += data.decode("ascii", errors="replace")
            *lines, self._text = self._text.split("\n")
            for line in lines:
                for reply in self._drive.chip.fw.command(line.strip()):
                    print(reply, flush=True)


def run_native(scenario: Scenario, bus_name: str, node_id: int, speed: float | None, seconds: float | None) -> None:
    """Run for a simulated time, or until Ctrl-C; says at the end how fast it was."""
    drive = drive_of_scenario(scenario, node_id)
    terminal = Terminal(drive)

    def stop() -> bool:
        terminal.poll()
        return seconds is not None and drive.now_us >= 1e6 * seconds

    with open_bus(bus_name) as bus:
        print(f"node {node_id} on {bus_name}, process {os.getpid()}", flush=True)
        begin = time.monotonic()
        try:
            serve(drive, bus, stop, speed)
        finally:
            print(f"{drive.now_us / 1e6:.3f} s simulated in {time.monotonic() - begin:.3f} s", flush=True)
