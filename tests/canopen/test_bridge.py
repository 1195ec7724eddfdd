# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The bridge between the chip's bus and python-can, with a node of the test's own in place of the simulator."""

from __future__ import annotations

import itertools
import os
import random
import signal
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path

import can
import pytest

from fluxlock.base.paths import ROOT
from fluxlock.can.can_bus import FULL
from fluxlock.can.frame import Frame
from fluxlock.config import ConfigError, load_scenario
from fluxlock.cosim.can_bridge import Bridge, frame_of, message_of
from fluxlock.cosim.can_command import join
from fluxlock.cosim.can_link import QUEUE, LinkPeer
from tests.canopen.chip_bench import MEGABIT

CHANNELS = itertools.count()
PATIENCE_S = 60.0
FRAMES = 2000
CAN_SCENARIO = ROOT / "scenarios" / "can.toml"


class SlowNode:
    """A bus that carries one frame each way a wake-up."""

    def __init__(self, frames: list[Frame]) -> None:
        self.queue: deque[Frame] = deque()
        self.from_chip = deque(frames)
        self.carried: list[Frame] = []
        self.longest = 0

    def send(self, frame: Frame) -> None:
        self.queue.append(frame)
        self.longest = max(self.longest, len(self.queue))

    def take(self) -> Frame | None:
        return self.from_chip.popleft() if self.from_chip and random.random() < 0.5 else None

    @property
    def waiting(self) -> int:
        return len(self.queue)

    def carry(self) -> None:
        if self.queue:
            self.carried.append(self.queue.popleft())


def classic(rng: random.Random) -> Frame:
    """A frame that python-can can hold: no length code above 8."""
    while (frame := Frame.draw(rng)).dlc > 8:
        pass
    return frame


def wait(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.002)


class Simulator:
    """Wakes a peer until it is finished, as a session does."""

    def __init__(self, bridge: Bridge, node: SlowNode) -> None:
        self.peer = LinkPeer(MEGABIT, bridge.link.address)
        self.node = node
        self.thread = threading.Thread(target=self._run)

    def _run(self) -> None:
        for cycle in itertools.count(0, 5000):
            self.peer.exchange(cycle, self.node)
            self.node.carry()
            if self.peer.finished:
                return


class FullBus:
    """A bus whose interface has no room now and then."""

    def __init__(self, bus: can.BusABC) -> None:
        self.bus, self.refused = bus, 0

    def send(self, message: can.Message, timeout: float | None = None) -> None:
        if random.random() < 0.2:
            self.refused += 1
            raise can.CanOperationError("no buffer space", error_code=FULL[0])
        self.bus.send(message, timeout)

    def recv(self, timeout: float) -> can.Message | None:
        return self.bus.recv(timeout)


@pytest.mark.parametrize("full", [False, True])
def test_nothing_lost_or_reordered(full: bool) -> None:
    """Random frames of all kinds both ways at once, faster than the bus carries them: each arrives once, in order.

    Verifies: CO-23
    """
    seed = random.randrange(1 << 32)
    print(f"seed {seed}")
    rng = random.Random(seed)
    out, back = ([classic(rng) for _ in range(FRAMES)] for _ in range(2))
    channel = f"bridge-{next(CHANNELS)}"
    with can.Bus(interface="virtual", channel=channel) as bus, can.Bus(interface="virtual", channel=channel) as peer:
        bridge = Bridge(FullBus(bus) if full else bus)  # type: ignore[arg-type]
        simulator = Simulator(bridge, SlowNode(out))
        bridge.start()
        # Before the simulator joins: they wait.
        for frame in back[: FRAMES // 2]:
            peer.send(message_of(frame))
        simulator.thread.start()
        for frame in back[FRAMES // 2 :]:
            peer.send(message_of(frame))
        heard: list[Frame | None] = []
        while len(heard) < FRAMES:
            message = peer.recv(PATIENCE_S)
            assert message is not None
            heard.append(frame_of(message))
        wait(lambda: len(simulator.node.carried) == FRAMES)
        bridge.stop()
        simulator.thread.join(PATIENCE_S)
        assert simulator.peer.finished
        assert peer.recv(0) is None
    assert heard == out
    assert simulator.node.carried == back
    assert simulator.node.longest <= QUEUE
    assert simulator.peer.conclusion() == {"from_chip": FRAMES, "to_chip": FRAMES}
    assert bridge.error is None


def test_own_frames_do_not_come_back() -> None:
    """UDP multicast hands a sender its own frames: those of the chip go out once, a peer's equal one comes in.

    Verifies: CO-23
    """
    frame, other = Frame(0x185, dlc=2, data=b"\x50\x02"), Frame(0x605, dlc=1, data=b"\x40")
    group = "239.74.163.77"
    kind = "udp_multicast"
    with can.Bus(interface=kind, channel=group) as bus, can.Bus(interface=kind, channel=group) as peer:
        bridge = Bridge(bus)
        simulator = Simulator(bridge, SlowNode([frame] * 3))
        bridge.start()
        simulator.thread.start()
        for _ in range(3):
            message = peer.recv(PATIENCE_S)
            assert message is not None
            assert frame_of(message) == frame
        wait(lambda: not bridge._echoes)
        for sent in (other, frame):
            peer.send(message_of(sent))
        wait(lambda: len(simulator.node.carried) == 2)
        bridge.stop()
        simulator.thread.join(PATIENCE_S)
    assert simulator.node.carried == [other, frame]


def test_bus_that_goes_away() -> None:
    """An interface that fails ends the run and is named; what is no frame of CAN 2.0 is left out.

    Verifies: CO-23
    """

    class Failing:
        def recv(self, timeout: float) -> can.Message | None:
            raise can.CanOperationError("network is down", error_code=100)

    bridge = Bridge(Failing())  # type: ignore[arg-type]
    simulator = Simulator(bridge, SlowNode([]))
    simulator.thread.start()
    assert bridge.link.wait(PATIENCE_S)
    bridge.start()
    simulator.thread.join(PATIENCE_S)
    assert simulator.peer.finished
    assert bridge.error is not None
    assert "network is down" in bridge.error
    assert frame_of(can.Message(is_fd=True, dlc=12, data=bytes(12))) is None
    assert frame_of(can.Message(is_error_frame=True)) is None


def command(*words: str) -> list[str]:
    return [sys.executable, "-m", "fluxlock", "can", *words]


@pytest.mark.parametrize(
    ("scenario", "bus", "text"),
    [
        ("can", "pigeon:1", "--can: pigeon:1: pigeon is no interface of python-can"),
        ("can", "socketcan:no_can9", r"--can: socketcan:no_can9: (.*modprobe vcan|.*ip link add no_can9)"),
        ("demo", "virtual:x", r"demo\.toml: can: is missing: the chip has a CAN bus only with it"),
    ],
)
def test_refused(scenario: str, bus: str, text: str) -> None:
    """What cannot be opened or has no bus is one line, with what to do, before anything is built.

    Verifies: CO-24
    """
    loaded = load_scenario(ROOT / "scenarios" / f"{scenario}.toml")
    with pytest.raises(ConfigError, match=text):
        join(loaded, bus)


def test_interrupted(tmp_path: Path) -> None:
    """Ctrl-C, as a terminal sends it to the whole group, ends the run with its results and exit code 0.

    Verifies: CO-24
    """
    words = command(str(CAN_SCENARIO), "--can", "udp_multicast:239.74.163.78", "--out", str(tmp_path))
    process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, process_group=0)
    try:
        # Other groups of this machine are heard too: the chip's boot-up is waited for, whatever else comes.
        with can.Bus(interface="udp_multicast", channel="239.74.163.78") as bus:
            while True:
                message = bus.recv(10 * PATIENCE_S)
                assert message is not None
                if (message.arbitration_id, bytes(message.data)) == (0x705, b"\0"):
                    break
    finally:
        os.killpg(process.pid, signal.SIGINT)
    out, errors = process.communicate(timeout=10 * PATIENCE_S)
    assert process.returncode == 0, errors
    first, verdict, *_, traffic, results = out.splitlines()
    assert first.startswith("node 5, 1000 kbit/s on udp_multicast:239.74.163.78, process ")
    assert verdict == "ok: no speed to judge"
    assert "times slower than real time; frames: 1 from the chip, " in traffic
    assert results == f"results in {tmp_path}"
    assert (tmp_path / "result.json").exists()
