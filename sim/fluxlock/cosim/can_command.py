# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The command `fluxlock can`: the chip on a bus of python-can until it is told to end."""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from fluxlock.base.stage import ProgressInfo
from fluxlock.can.can_bus import open_bus
from fluxlock.clock import CLOCK_HZ
from fluxlock.config import ConfigError, Scenario
from fluxlock.cosim.can_bridge import Bridge, run_on_bus
from fluxlock.cosim.outcome import write_outcome
from fluxlock.generate.registers import check_build
from fluxlock.results.verdict import say

if TYPE_CHECKING:
    import can

LONGEST_S = 3600.0
REPORT_S = 5.0


@contextmanager
def _ended_by_interrupt(bridge: list[Bridge]) -> Iterator[None]:
    """Ctrl-C stops the bridge, which ends the run; a second one, or one before it runs, interrupts as ever."""

    def stop(number: int, frame: object) -> None:
        if not bridge:
            raise KeyboardInterrupt
        bridge.pop().stop()

    before = signal.signal(signal.SIGINT, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


class _Lines:
    """A line of progress now and then: stdout stays readable beside candump."""

    def __init__(self) -> None:
        self._due = 0.0

    def __call__(self, info: ProgressInfo) -> None:
        now = time.monotonic()
        if now < self._due or info.rate_cycles_per_s <= 0:
            return
        self._due = now + REPORT_S
        times = CLOCK_HZ / info.rate_cycles_per_s
        text = f"{info.t_s:.3f} s, {info.speed_rpm:.0f} r/min, {times:.0f} times slower than real time"
        print(text, file=sys.stderr, flush=True)


def join(scenario: Scenario, name: str) -> can.BusABC:
    """The bus for a scenario; ConfigError if one of the two is not to be had. name: INTERFACE:CHANNEL."""
    if scenario.can is None:
        text = "is missing: the chip has a CAN bus only with it; add the table [can]"
        raise ConfigError([scenario.sources.problem("can", text)])
    return open_bus(name)


def run_can(
    scenario: Scenario, bus: can.BusABC, bus_name: str, out_dir: Path, seed: int, seconds: float | None
) -> bool:
    """Run for a simulated time or until Ctrl-C, print verdict and traffic, write the results. bus: of `join`.

    False: the run cannot be vouched for.
    """
    assert scenario.can is not None
    bus_of_chip = scenario.can
    check_build()
    print("building what has changed; a chip takes minutes", file=sys.stderr, flush=True)
    limit = seconds if seconds is not None else LONGEST_S
    bare = scenario.model_copy(update={"window": [], "expect": [], "duration_s": limit})
    running: list[Bridge] = []
    with _ended_by_interrupt(running):

        def ready(bridge: Bridge) -> None:
            running.append(bridge)
            chip = f"node {bus_of_chip.node_id}, {bus_of_chip.bit_rate_kbit_per_s} kbit/s"
            print(f"{chip} on {bus_name}, process {os.getpid()}", flush=True)

        data, traffic = run_on_bus(bare, bus, out_dir, seed, limit, _Lines(), ready)
    # Two records are the least that has a course.
    if data.records.size < 2:
        print(traffic.text, flush=True)
        return True
    ended = bare.model_copy(update={"duration_s": traffic.simulated_s})
    outcome = write_outcome(data, ended, out_dir, by_bus=True)
    say(outcome.verdict)
    print(traffic.text, flush=True)
    print(f"results in {out_dir}", flush=True)
    return outcome.verdict.passed
