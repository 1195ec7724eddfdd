# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The bus of the simulated chip on a bus of python-can: SocketCAN, UDP multicast, virtual.

Frames keep their order in each direction. Towards the chip they wait until the simulated bus carries them; towards
python-can the simulation waits until the interface has room.
"""

from __future__ import annotations

import socket
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import can

from fluxlock.base.stage import Progress
from fluxlock.can.can_bus import has_taken
from fluxlock.can.frame import Frame
from fluxlock.can.timing import chip_timing
from fluxlock.clock import CLOCK_HZ
from fluxlock.config import Scenario
from fluxlock.cosim.can_link import CanLink, LinkPeer
from fluxlock.cosim.launch import SimulatorError, run_plan
from fluxlock.cosim.run import chip_of, collect, prepare
from fluxlock.results.rundata import RunData, SimulationFault

# Between two exchanges with the simulated bus: a tenth of a millisecond, about one frame.
BATCH_CYCLES = 5_000
POLL_S = 0.05
RETRY_S = 0.001
# A kernel's buffer: what comes in a burst while the reader has no turn.
RECEIVE_BYTES = 1 << 22
# Interfaces that hand a sender its own frames back.
ECHOING = ("UdpMulticastBus",)
ECHOES_MAX = 4096


@dataclass(frozen=True)
class Traffic:
    """What passed, and how fast."""

    from_chip: int
    to_chip: int
    simulated_s: float
    wall_s: float

    @property
    def text(self) -> str:
        """In a line, for people."""
        times = self.wall_s / self.simulated_s if self.simulated_s > 0 else 0.0
        pace = f"{self.simulated_s:.3f} s simulated in {self.wall_s:.1f} s, {times:.0f} times slower than real time"
        return f"{pace}; frames: {self.from_chip} from the chip, {self.to_chip} to it"


def frame_of(message: can.Message) -> Frame | None:
    """None: no frame of CAN 2.0."""
    if message.is_error_frame or message.is_fd or message.dlc > 8:
        return None
    data = b"" if message.is_remote_frame else bytes(message.data)
    return Frame(message.arbitration_id, message.is_extended_id, message.is_remote_frame, message.dlc, data)


def message_of(frame: Frame) -> can.Message:
    """A length code above 8 means 8 bytes."""
    return can.Message(
        arbitration_id=frame.id,
        is_extended_id=frame.ext,
        is_remote_frame=frame.rtr,
        dlc=min(frame.dlc, 8),
        data=None if frame.rtr else frame.data,
    )


class Bridge:
    """Both directions, each in a thread, from `start` until `stop` or until one side ends."""

    def __init__(self, bus: can.BusABC) -> None:
        self.bus = bus
        self.error: str | None = None
        self.from_chip = self.to_chip = 0
        self._stop = threading.Event()
        self._echoes: deque[Frame] | None = deque(maxlen=ECHOES_MAX) if type(bus).__name__ in ECHOING else None
        kernel = getattr(bus, "socket", None)
        if isinstance(kernel, socket.socket):
            kernel.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BYTES)
        self.link = CanLink(self._out)
        self._reader = threading.Thread(target=self._in, daemon=True)

    def start(self) -> None:
        """Hand frames on as soon as the simulator has joined."""
        self._reader.start()

    def stop(self) -> None:
        """End the run at the simulator's next wake-up; from any thread, any number of times."""
        if not self._stop.is_set():
            self._stop.set()
            self.link.close()

    def _fail(self, error: Exception) -> None:
        if not self._stop.is_set():
            self.error = f"bus: {error}"
        self.stop()

    def _out(self, frame: Frame) -> None:
        message = message_of(frame)
        if self._echoes is not None:
            self._echoes.append(frame)
        while not self._stop.is_set():
            try:
                taken = has_taken(self.bus, message)
            except can.CanOperationError as error:
                self._fail(error)
                return
            if taken:
                self.from_chip += 1
                return
            time.sleep(RETRY_S)

    def _in(self) -> None:
        # What came before the simulator joined waits here.
        waiting: deque[Frame] = deque()
        while not self._stop.is_set():
            try:
                message = self.bus.recv(POLL_S)
            except (can.CanError, OSError) as error:
                self._fail(error)
                return
            frame = frame_of(message) if message is not None else None
            if frame is not None and not self._is_echo(frame):
                waiting.append(frame)
            while waiting and self.link.send(waiting[0]):
                waiting.popleft()
                self.to_chip += 1

    def _is_echo(self, frame: Frame) -> bool:
        if self._echoes is None or frame not in self._echoes:
            return False
        self._echoes.remove(frame)
        return True


def run_on_bus(
    scenario: Scenario,
    bus: can.BusABC,
    out_dir: Path,
    seed: int,
    seconds: float,
    progress: Progress | None = None,
    ready: Callable[[Bridge], None] | None = None,
) -> tuple[RunData, Traffic]:
    """Run a scenario with its bus on a bus of python-can, for a simulated time or until the bridge is stopped.

    ready: gets the bridge when everything is built. Raises SimulationFault if the run broke off, also if the bus did.
    """
    assert scenario.can is not None
    try:
        chip = chip_of(scenario)
        plan = prepare(scenario, out_dir / "simulator", seed, stop_cycle=round(seconds * CLOCK_HZ))
        bridge = Bridge(bus)
        timing = chip_timing(CLOCK_HZ, scenario.can.bit_rate_kbit_per_s)
        plan = replace(plan, peer=LinkPeer(timing, bridge.link.address), batch_cycles=BATCH_CYCLES)
        if ready is not None:
            ready(bridge)
        bridge.start()
        try:
            meta = run_plan(plan, chip, progress, own_group=True)
        finally:
            bridge.stop()
    except (SimulatorError, RuntimeError) as error:
        raise SimulationFault(str(error)) from error
    data = collect(plan, meta, scenario.motor.pole_pairs)
    if meta["fault"] or bridge.error:
        raise SimulationFault(str(meta["fault"] or bridge.error), data)
    seen = meta["conclusion"]
    return data, Traffic(seen["from_chip"], seen["to_chip"], meta["cycles"] / CLOCK_HZ, meta["wall_s"])
