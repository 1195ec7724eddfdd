# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The whole controller on a bus in continuous time, with independent nodes and a second controller.

FLUXLOCK_CAN_FRAMES sets the number of frames of the traffic test.
"""

from __future__ import annotations

import os
import random
from dataclasses import replace
from itertools import pairwise
from typing import Any

import cocotb
from cocotb.triggers import gather
from cocotb.utils import get_sim_time

from cocotb_tests.can.bench import BENCHES, CAN_SOURCES, CLOCK_NS, told_apart
from cocotb_tests.can.link import Link, accept, filters
from fluxlock.can.frame import Frame
from fluxlock.can.timing import BitTiming
from fluxlock.cosim.block import run_block_test

FRAMES = int(os.environ.get("FLUXLOCK_CAN_FRAMES", "240"))
FAST = BitTiming(1, 9, 3, 3, 2)
MEGABIT = BitTiming(2, 9, 7, 8, 4)


@cocotb.test
async def traffic(dut: Any) -> None:
    """Two controllers and two nodes whose clocks differ send whenever they can: nothing lost, doubled or changed.

    Verifies: CAN-06, CAN-13, CAN-14
    """
    rng = random.Random(random.randrange(1 << 32))
    link = Link(dut, FAST, delay_ns=2.0)
    error = min(FAST.tolerance, 0.005)
    nodes = [link.node(error, 3.0, 7.3), link.node(-error, 1.0, 100.9)]
    await link.start()
    sources = [[told_apart(Frame.draw(rng), x) for _ in range(FRAMES // 4)] for x in range(4)]
    nodes[0].mac.queue.extend(sources[2])
    nodes[1].mac.queue.extend(sources[3])
    await gather(*(link.send(x, sources[x]) for x in range(2)))
    # The nodes' frames lose most fights.
    await link.rest(200 * FRAMES)
    for x in range(4):
        got = [entry.frame for entry in link.received[x]] if x < 2 else nodes[x - 2].mac.received
        for y in range(4):
            from_y = [f for f in got if f.id >> (18 if f.ext else 0) & 3 == y]
            assert from_y == (sources[y] if y != x else []), f"{x} received {len(from_y)} frames of {y}"
    assert not any(node.mac.faults for node in nodes)
    assert [link.counts(x) for x in range(2)] == [(0, 0), (0, 0)]
    for entries in link.received:
        stamps = [entry.stamp for entry in entries]
        # Not closer than the shortest frame, three bits of intermission included.
        assert all(b - a >= 47 * FAST.bit_cycles * 0.99 for a, b in pairwise(stamps))
        assert not any(entry.lost for entry in entries)


@cocotb.test
@cocotb.parametrize(timing=[FAST, MEGABIT, BitTiming(1, 8, 5, 2, 1), BitTiming(1, 7, 2, 5, 2)], fast=[True, False])
async def clock_error_at_the_limit(dut: Any, timing: BitTiming, fast: bool) -> None:
    """Nodes apart by the error that the bit timing bears on either side, long runs without an edge: no error.

    Verifies: CAN-15
    """
    rng = random.Random(random.randrange(1 << 32))
    link = Link(dut, timing, delay_ns=2.0)
    error = 2 * min(timing.tolerance, 0.005)
    node = link.node(error if fast else -error, 2.0, rng.uniform(0, 100))
    await link.start(enable_i=1)
    stuffed = [Frame(0, dlc=8, data=bytes(8)), Frame(0x1FFF_FFFC, ext=True, dlc=8, data=b"\xff" * 8)]
    mine = [told_apart(frame, 0) for frame in [*stuffed, *(Frame.draw(rng) for _ in range(4))]]
    others = [told_apart(frame, 1) for frame in [*stuffed, *(Frame.draw(rng) for _ in range(4))]]
    node.mac.queue.extend(others)
    await link.send(0, mine)
    await link.rest()
    assert node.mac.received == mine and [entry.frame for entry in link.received[0]] == others
    assert not node.mac.faults and link.counts(0) == (0, 0), f"{node.mac.faults[:9]}, {link.counts(0)}"


@cocotb.test
async def clock_error_far_beyond_it(dut: Any) -> None:
    """The test above can fail: at several times the error frames with long runs break.

    Verifies: CAN-15
    """
    link = Link(dut, FAST)
    node = link.node(6 * FAST.tolerance)
    await link.start(enable_i=1)
    node.mac.queue.append(Frame(0, dlc=8, data=bytes(8)))
    await link.bits(300)
    assert node.mac.faults or link.counts(0)[1]


@cocotb.test
async def disturbed_bus(dut: Any) -> None:
    """Short disturbances of both levels anywhere: what a sender holds for sent has reached everybody, and all is sent.

    A node that was error passive, whose flag stops nobody, may lack frames, but never has one twice or out of turn.

    Verifies: CAN-08, CAN-14
    """
    rng = random.Random(random.randrange(1 << 32))
    link = Link(dut, FAST, delay_ns=1.0)
    node = link.node(0.001, 2.0)
    await link.start()
    sources = [
        [told_apart(replace(Frame.draw(rng), dlc=1, rtr=False, data=bytes([i])), x) for i in range(12)]
        for x in range(3)
    ]
    node.mac.queue.extend(sources[2])
    for i in range(60):
        begin = get_sim_time("ns") + (40 + i * 60 + rng.uniform(0, 60)) * link.bit_ns
        link.bus.force(begin, begin + rng.uniform(0.05, 2.0) * link.bit_ns, rng.randrange(2))
    passive = set()

    async def watch() -> None:
        while True:
            await link.bits(4)
            most = [max(link.counts(0)), max(link.counts(1)), max(node.mac.tec, node.mac.rec)]
            passive.update(x for x in range(3) if most[x] > 127)

    watcher = cocotb.start_soon(watch())
    await gather(*(link.send(x, sources[x]) for x in range(2)))
    await link.rest()
    watcher.cancel()
    # Bus-off nodes come back by themselves.
    received = [[entry.frame for entry in link.received[x]] for x in range(2)] + [node.mac.received]
    for x in range(3):
        for y in range(3):
            if x != y:
                got = list(dict.fromkeys(f for f in received[x] if f in sources[y]))
                due = [f for f in sources[y] if x not in passive or f in got]
                assert got == due, f"{x} received {len(got)} of {len(sources[y])} frames of {y}"


@cocotb.test
async def buffers_by_priority_and_abort(dut: Any) -> None:
    """The highest priority goes first, the lower number among equals; aborted ones do not, except the one on the bus.

    Verifies: CAN-16, CAN-17
    """
    rng = random.Random(random.randrange(1 << 32))
    link = Link(dut, FAST)
    await link.start()
    await link.bits(12)
    events = {"sent_o": [0] * 6, "aborted_o": [0] * 6, "refused_o": [0] * 6}

    async def count(name: str) -> None:
        while True:
            await getattr(dut, name).value_change
            for x in range(6):
                events[name][x] += int(getattr(dut, name).value) >> x & 1

    for name in events:
        cocotb.start_soon(count(name))
    for _ in range(12):
        before = len(link.received[1])
        blocker = Frame(0, dlc=0)
        await link.put(0, 0, blocker)
        await link.bits(5)
        await link.put(0, 0, Frame(0x7FF))  # refused: it waits
        drawn = [(rng.randrange(4), x) for x in (1, 2)]
        frames = {x: Frame(rng.randrange(1, 0x7FF), dlc=1, data=bytes([x])) for x in (1, 2)}
        for priority, x in rng.sample(drawn, 2):
            await link.put(0, x, frames[x], priority)
        victims = [x for x in range(3) if rng.random() < 0.3]
        await link.pulse("abort_i", sum(1 << x for x in victims))
        await link.rest()
        order = [x for _, x in sorted(drawn, key=lambda p: (-p[0], p[1])) if x not in victims]
        got = [entry.frame for entry in link.received[1][before:]]
        assert got == [blocker, *(frames[x] for x in order)], f"{drawn}, aborted {victims}: {got}"
    assert sum(events["sent_o"]) == len(link.received[1]) and events["refused_o"][0] == 12
    assert sum(events["sent_o"]) + sum(events["aborted_o"]) == 36
    # Nobody acknowledges: the frame on the bus is given up when its attempt ends.
    await link.rest()
    dut.enable_i.value = 1
    await link.put(0, 0, Frame(0x155))
    await link.bits(100)
    await link.pulse("abort_i", 1)
    await link.rest()
    assert events["aborted_o"][0] >= 1 and link.counts(0)[0] > 0


@cocotb.test
async def filters_and_full_fifo(dut: Any) -> None:
    """Masks, both formats, remote frames, first match; 32 frames are kept, then the loss is told; stamps.

    Verifies: CAN-18, CAN-19, CAN-20
    """
    rng = random.Random(random.randrange(1 << 32))
    link = Link(dut, FAST)
    node = link.node()
    words = [
        accept(0x123, 0x7FF, ext=False, rtr=False),
        accept(0x100, 0x700, ext=False),
        accept(0x0ABC_DE00, 0x1FFF_FF00, ext=True),
        accept(rtr=True),
        0,
        accept(0x55, 0x1FFF_FFFF) & ~(1 << 62),  # not enabled
        accept(0x7, 0x7, ext=True),
        accept(0x7F0, 0x7F0, ext=False),
    ]
    await link.start(filters(*words), enable_i=1)

    def first(frame: Frame) -> int | None:
        kinds = [(not frame.ext and not frame.rtr and frame.id == 0x123), (not frame.ext and frame.id >> 8 == 1)]
        kinds += [frame.ext and frame.id >> 8 == 0xABCDE, frame.rtr, False, False, frame.ext and frame.id & 7 == 7]
        kinds += [not frame.ext and frame.id >> 4 == 0x7F]
        return next((i for i, hit in enumerate(kinds) if hit), None)

    frames = []
    for _ in range(70):
        ext, rtr = rng.random() < 0.5, rng.random() < 0.2
        near = [0x0ABC_DE00 + rng.randrange(-64, 320), rng.getrandbits(29), 0x55] if ext else []
        near += [] if ext else [0x123, 0x100 + rng.randrange(-64, 320), 0x7F0 + rng.randrange(-16, 16), 0x55]
        frames.append(Frame(rng.choice(near), ext, rtr, 0))
    node.mac.queue.extend(frames)
    await link.rest()
    wanted = [(frame, first(frame)) for frame in frames if first(frame) is not None]
    assert [(entry.frame, entry.filter) for entry in link.received[0]] == wanted
    # Overrun.
    del link.received[0][:]
    link.reading[0] = False
    dut.filter_i.value = accept()
    many = [Frame(i, dlc=1, data=bytes([i])) for i in range(35)]
    node.mac.queue.extend(many)
    await link.rest()
    assert int(dut.rx_lost_count_o.value) & 0xFF == 3
    link.read_on(0)
    await link.bits(10)
    assert [(entry.frame, entry.lost) for entry in link.received[0]] == [(frame, False) for frame in many[:32]]
    node.mac.queue.extend(many[:2])
    start = get_sim_time("ns") - link.zero_ns
    await link.rest()
    assert [entry.lost for entry in link.received[0][32:]] == [True, False]
    bits = [(entry.stamp * CLOCK_NS - start) / link.bit_ns for entry in link.received[0][32:]]
    # Data length 1: 55 bits and the stuff bits, three of intermission.
    assert -2 < bits[0] < 4 and 55 <= bits[1] - bits[0] < 72, bits


@cocotb.test
async def silent_modes(dut: Any) -> None:
    """Listening, looping back and disabled the pin stays recessive; listening hears all, looping back only itself.

    Verifies: CAN-12, CAN-21
    """
    link = Link(dut, FAST)
    nodes = [link.node(), link.node(0.001)]
    await link.start(enable_i=0b11, listen_i=1, loopback_i=2)
    frames = [Frame(0x123, dlc=2, data=b"ab"), Frame(0x7)]
    nodes[0].mac.queue.extend(frames)
    await link.put(0, 0, Frame(0x1))
    for frame in frames[::-1]:
        await link.put(1, 0, frame)
        await link.bits(150)
    await link.bits(200)
    # A broken frame, too: a listener raises no flag.
    nodes[1].mac.queue.append(Frame(0x0, dlc=8, data=bytes(8)))
    begin = get_sim_time("ns") + 30 * link.bit_ns
    link.bus.force(begin, begin + 8 * link.bit_ns, 0)
    await link.bits(300)
    assert [entry.frame for entry in link.received[0]][:2] == frames
    assert [entry.frame for entry in link.received[1]] == frames[::-1]
    assert int(dut.pending_o.value) & 7 == 1 and link.counts(0) == (0, 0)
    # A change of the mode needs a disabled controller.
    dut.listen_i.value = 0
    await link.bits(50)
    assert link.edges == [0, 0] and int(dut.tx_o.value) == 3
    dut.enable_i.value = 0
    dut.loopback_i.value = 0
    await link.bits(50)
    assert link.edges == [0, 0] and int(dut.pending_o.value) & 7 == 1
    dut.enable_i.value = 0b11
    await link.rest()
    assert link.edges[0] > 0 and nodes[0].mac.received[-1] == Frame(0x1)
    # Disabled in the middle of its frame: recessive within two clocks.
    await link.put(0, 1, Frame(0x0, dlc=8, data=bytes(8)))
    await link.bits(40)
    while int(dut.tx_o.value) & 1:
        await dut.tx_o.value_change
    await link.pulse("enable_i", 0b10)
    assert int(dut.tx_o.value) & 1


def test_fl_can() -> None:
    """The controller."""
    run_block_test("fl_can_bench", [*CAN_SOURCES, BENCHES / "fl_can_bench.sv"], __name__)
