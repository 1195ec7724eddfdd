# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The simulator's native CAN node beside the Python node, bit by bit on one bus, disturbed and not."""

from __future__ import annotations

import os
import random
import subprocess
from functools import cache
from math import ceil
from pathlib import Path

import pytest

from cocotb_tests.can.bench import told_apart
from fluxlock.base.paths import BUILD, ROOT, content_hash
from fluxlock.can.bus import Bus
from fluxlock.can.frame import Frame
from fluxlock.can.mac import Fault, Mac
from fluxlock.can.timing import BitTiming
from fluxlock.headers import CData, bind

NATIVE = ROOT / "sim" / "native"
HEADER = Path(__file__).with_name("native_node.h")
SOURCES = [HEADER.with_suffix(".cpp"), HEADER, NATIVE / "can_node.h", NATIVE / "can_bus.h"]
BITS = 12_000
BUS_JOINED = 2000  # clocks: every node has seen its eleven recessive bits


@cache
def types() -> CData:
    """Of the node and the bus."""
    return bind([HEADER], HEADER.parent)


@pytest.fixture(scope="module")
def library() -> CData:
    folder = BUILD / "can"
    folder.mkdir(parents=True, exist_ok=True)
    target = folder / f"native_node-{content_hash(SOURCES)}.so"
    if not target.exists():
        part = target.with_suffix(f".{os.getpid()}")
        flags = ["-shared", "-fPIC", "-O1", "-std=c++17", "-Wall", "-Wextra", "-Werror", "-I", str(NATIVE)]
        subprocess.run([os.environ.get("CXX", "c++"), *flags, str(SOURCES[0]), "-o", str(part)], check=True)
        part.replace(target)
    return types().dlopen(str(target))


class Native:
    """A native node."""

    def __init__(self, lib: CData, node: CData) -> None:
        self.lib, self.node = lib, node
        self.view = types().new("int64_t[8]")
        self.look()

    def look(self) -> None:
        self.lib.node_step(self.node, -1, self.view)

    def send(self, frame: Frame) -> None:
        self.lib.node_send(self.node, frame.id, frame.ext, frame.rtr, frame.dlc, frame.data)

    @property
    def last(self) -> Frame:
        """The last frame received."""
        head, data = types().new("uint32_t[4]"), types().new("uint8_t[8]")
        self.lib.node_last(self.node, head, data)
        count = 0 if head[2] else min(head[3], 8)
        assert not any(data[count:8])
        return Frame(head[0], bool(head[1]), bool(head[2]), head[3], bytes(data[0:count]))


def open_node(lib: CData, bus: CData, now: int, timing: BitTiming, error: float = 0.0, delay: float = 0.0) -> CData:
    """A node on a native bus."""
    segments = (timing.brp, timing.prop, timing.ps1, timing.ps2, timing.sjw)
    return lib.bus_open(bus, now, *segments, error, delay)


class Pair(Native):
    """A native node and its twin, which see the same bus and must do the same."""

    def __init__(self, lib: CData) -> None:
        super().__init__(lib, lib.node_new())
        self.mac = Mac()
        self.bits = 0

    @property
    def level(self) -> int:
        return self.view[0]

    def send(self, frame: Frame) -> None:
        self.mac.queue.append(frame)
        super().send(frame)

    def step(self, seen: int) -> None:
        mac, before = self.mac, len(self.mac.received)
        mac.step(seen)
        self.lib.node_step(self.node, seen, self.view)
        self.bits += 1
        wanted = [mac.level, mac.between, mac.bus_off, mac.tec, mac.rec, len(mac.sent), len(mac.faults)]
        wanted.append(len(mac.received))
        assert list(self.view) == wanted, f"bit {self.bits}, after {mac.faults[-2:]}"
        if len(mac.received) > before:
            assert self.last == mac.received[-1]


@pytest.mark.parametrize("rate", [0.0, 0.003, 0.01, 0.1])
def test_bit_by_bit(library: CData, rate: float) -> None:
    """Levels, counters, bus-off, frames and errors of three nodes; flips and bursts seen by all or by one.

    Verifies: CAN-25
    """
    seed = random.randrange(1 << 32)
    print(f"seed {seed}")
    rng = random.Random(seed)
    pairs = [Pair(library) for _ in range(3)]
    burst, level = 0, 0
    urge = 0.02 if rate else 0.002  # a full bus, and one on which everybody's turn comes
    for _ in range(BITS):
        for number, pair in enumerate(pairs):
            if len(pair.mac.queue) < 2 and rng.random() < urge:
                pair.send(told_apart(Frame.draw(rng), number))
        bus = min(pair.level for pair in pairs)
        if burst:
            burst -= 1
            bus = level
        elif rng.random() < rate / 10:
            burst, level = rng.choice([7, 12, 30, 900]), rng.randrange(2)
        alone = rng.randrange(3) if rng.random() < 0.5 else None
        flip = rng.random() < rate
        for number, pair in enumerate(pairs):
            pair.step(bus ^ (flip and alone in (None, number)))
    faults = {fault for pair in pairs for fault in pair.mac.faults}
    if rate == 0.0:
        assert not faults and all(len(pair.mac.sent) > 5 for pair in pairs)
        for x, pair in enumerate(pairs):
            others = [frame for y, other in enumerate(pairs) if y != x for frame in other.mac.sent]
            assert len(pair.mac.received) in (len(others), len(others) + 1)
    else:
        assert faults >= {Fault.BIT, Fault.STUFF, Fault.FORM}


def test_alone(library: CData) -> None:
    """Nobody acknowledges: error passive and no further; bits flipped while it sends: bus-off, and back.

    Verifies: CAN-25
    """
    pair = Pair(library)
    pair.send(Frame(0x123, dlc=1, data=b"\x55"))
    for _ in range(4000):
        pair.step(pair.level)
    assert pair.mac.passive and pair.mac.tec == 128
    for _ in range(4000):
        pair.step(1)
    assert pair.mac.bus_off or Fault.BIT in pair.mac.faults
    for _ in range(1500):
        pair.step(pair.level)
    assert not pair.mac.bus_off


def test_bus(library: CData) -> None:
    """Nodes with other segments and phases, and one of the Python bus at the chip's place: nothing lost or changed.

    Verifies: CAN-25
    """
    seed = random.randrange(1 << 32)
    print(f"seed {seed}")
    rng = random.Random(seed)
    bus = library.bus_new()
    timings = [BitTiming(5, 10, 6, 3, 3), BitTiming(10, 4, 3, 2, 2), BitTiming(4, 12, 8, 4, 4)]
    # The chip: a node whose clock is fast by 0.2 %. Times are clocks.
    there = Bus()
    chip = there.node(BitTiming(5, 10, 6, 3, 3), 5 / 1.002, 0.0, rng.uniform(0, 90))
    here = there.port(0.0, lambda now, level: None)
    natives: list[Native] = []
    for timing in timings:
        now = rng.randrange(100)
        natives.append(Native(library, open_node(library, bus, now, timing)))
    frames = [[told_apart(Frame.draw(rng), x) for _ in range(25)] for x in range(4)]
    chip.mac.queue.extend(frames[3])
    for native, own in zip(natives, frames, strict=False):
        for frame in own:
            native.send(frame)
    got: list[list[Frame]] = [[], [], []]
    now = 0
    for _ in range(1_000_000):
        now = min(ceil(there.wake_at), library.bus_next(bus))
        there.run(now)
        library.bus_chip(bus, now, chip.port.arrived)
        library.bus_run(bus, now)
        here.drive(now, library.bus_level(bus))
        there.run(now)
        for native, taken in zip(natives, got, strict=True):
            before = native.view[7]
            native.look()
            if native.view[7] > before:
                taken.append(native.last)
        if not chip.mac.queue and all(native.view[5] == 25 for native in natives) and now > 4_000_000:
            break
    for x, taken in enumerate([*got, chip.mac.received]):
        for y in range(4):
            from_y = [f for f in taken if f.id >> (18 if f.ext else 0) & 3 == y]
            assert from_y == (frames[y] if y != x else []), f"{x} received {len(from_y)} frames of {y}"
    assert not chip.mac.faults and not any(native.view[6] for native in natives)


@pytest.mark.parametrize("disturbed", [False, True])
def test_delays_errors_disturbances(library: CData, disturbed: bool) -> None:
    """Nodes far apart, clocks fast and slow up to what the timing bears: levels and nodes as on the Python bus.

    Undisturbed nothing is lost or changed.

    Verifies: CAN-27
    """
    seed = random.randrange(1 << 32)
    print(f"seed {seed}")
    rng = random.Random(seed)
    bus = library.bus_new()
    timing = BitTiming(2, 9, 7, 8, 4)
    here = Bus()
    chip = here.port(0.0, lambda now, level: None)
    macs, natives = [], []
    for _ in range(4):
        error = rng.choice([-1, 1]) * min(0.005, timing.tolerance)
        # There and back within the propagation segment.
        delay = rng.uniform(0, (timing.prop - 1) * timing.brp / 4)
        now = rng.randrange(100)
        node = here.node(timing, timing.brp / (1.0 + error), delay, float(now))
        macs.append(node.mac)
        natives.append(Native(library, open_node(library, bus, now, timing, error, delay)))
    frames = [[told_apart(Frame.draw(rng), x) for _ in range(12)] for x in range(4)]
    now, change, forced_until = 0, BUS_JOINED, 0
    while now < 1_500_000:
        if now == BUS_JOINED:
            for mac, native, own in zip(macs, natives, frames, strict=True):
                mac.queue.extend(own)
                for frame in own:
                    native.send(frame)
        now = min(ceil(here.wake_at), library.bus_next(bus), change)
        if now == change:  # the chip's place, without a protocol: a glitch of a few clocks
            level = 1 - chip.sent if disturbed else 1
            here.run(now - 1)
            chip.drive(now, level)
            library.bus_chip(bus, now, level)
            change = now + (rng.randrange(1, 40) if level == 0 else rng.randrange(20_000, 60_000))
        elif disturbed and now > forced_until and rng.random() < 0.0005:
            start, end, level = now + rng.randrange(1, 50), now + rng.randrange(50, 400), rng.randrange(2)
            forced_until = end
            here.force(start, end, level)
            library.bus_force(bus, start, end, level)
        here.run(now)
        library.bus_run(bus, now)
        assert library.bus_level(bus) == here.level
        for mac, native in zip(macs, natives, strict=True):
            native.look()
            found = list(native.view)
            wanted = [mac.level, mac.between, mac.bus_off, mac.tec, mac.rec, len(mac.sent), len(mac.faults)]
            assert found == [*wanted, len(mac.received)], now
        if not any(mac.queue for mac in macs) and now > 900_000:
            break
    assert not any(mac.queue for mac in macs)
    assert any(mac.faults for mac in macs) == disturbed
    for x, mac in enumerate(macs):
        for y in range(4):
            got = [f for f in mac.received if f.id >> (18 if f.ext else 0) & 3 == y]
            assert disturbed or got == (frames[y] if y != x else [])
