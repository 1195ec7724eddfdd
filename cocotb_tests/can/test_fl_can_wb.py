# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The controller through its registers, on a bus with an independent node. Addresses are those of the C header."""

from __future__ import annotations

import random
from dataclasses import replace
from typing import Any

import cocotb
from cocotb.triggers import RisingEdge
from cocotb.utils import get_sim_time

from cocotb_tests.can.bench import CAN_SOURCES
from cocotb_tests.can.link import Wire
from cocotb_tests.soc.bench import Bench
from fluxlock.can.frame import Frame
from fluxlock.can.mac import Fault
from fluxlock.can.timing import BitTiming
from fluxlock.cosim.block import run_block_test
from fluxlock.firmware.host import register_offsets

FAST = BitTiming(1, 9, 3, 3, 2)
ENABLE, LISTEN, LOOPBACK, RECOVER = 1, 2, 4, 8
RECEIVED, OVERRUN, ERROR, STATE = (1 << i for i in range(4))
SENT, ABORTED, REFUSED = 1 << 4, 1 << 8, 1 << 12  # of buffer 0
WARNING, PASSIVE, BUS_OFF = 1 << 5, 1 << 6, 1 << 7
FILTER_ENABLE = 1 << 29
KINDS = 3 << 30  # of a filter's mask: format and kind must be equal
BIT_ERROR, ACK_ERROR = 1, 4


def name_word(frame: Frame) -> int:
    """The frame's identifier register."""
    return frame.ext << 31 | frame.rtr << 30 | frame.id


class TB(Bench):
    """A controller that is given everything by its registers."""

    def __init__(self, dut: Any) -> None:
        super().__init__(dut)
        self.wire = Wire(dut, FAST, 1, delay_ns=2.0)
        self.offsets = register_offsets()
        self.pulses = 0  # of event_o

    def at(self, name: str, index: int = 0) -> int:
        return (self.offsets[f"can.{name}"] & 0xFFF) + 4 * index

    async def set(self, name: str, value: int, index: int = 0) -> None:
        await self.write(self.at(name, index), value)

    async def get(self, name: str, index: int = 0) -> int:
        return await self.read(self.at(name, index))

    async def begin(self, control: int = ENABLE | RECOVER, accept: bool = True) -> None:
        """Bit timing, a filter that takes all, and the control register; on the bus after eleven bits."""
        await self.start(rx_i=1, now_i=0)
        self.wire.join()
        timing = FAST
        word = timing.brp - 1 | (timing.prop + timing.ps1 - 1) << 8 | (timing.ps2 - 1) << 16 | (timing.sjw - 1) << 24
        await self.set("bit_timing", word)
        await self.set("filter_mask", FILTER_ENABLE if accept else 0)
        await self.set("control", control)
        cocotb.start_soon(self._count())
        await self.bits(15)

    async def _count(self) -> None:
        while True:
            await RisingEdge(self.dut.clk_i)
            self.pulses += int(self.dut.event_o.value)

    async def bits(self, count: float) -> None:
        await self.wire.bits(count)
        await self.clocks()

    async def put(self, buffer: int, frame: Frame, urgency: int = 0) -> None:
        data = int.from_bytes(frame.data, "little")
        await self.set("tx_id", name_word(frame))
        await self.set("tx_data", data & 0xFFFF_FFFF, 0)
        await self.set("tx_data", data >> 32, 1)
        await self.set("tx_command", 1 << buffer | frame.dlc << 8 | urgency << 12)
        await self.clocks()  # as far apart as accesses through the interconnect

    async def quiet(self, limit_bits: int = 60_000) -> None:
        """Until nothing waits, and a little longer."""
        for _ in range(limit_bits // 10):
            await self.bits(10)
            if not (await self.get("status") & 7 or any(node.mac.queue for node in self.wire.bus.nodes)):
                await self.bits(20)
                return
        raise AssertionError("frames still wait")

    async def oldest(self) -> tuple[Frame, int, bool, int]:
        """The oldest frame, the filter, whether some were lost before it, the stamp."""
        word, info = await self.get("rx_id"), await self.get("rx_info")
        assert info >> 31, "no frame"
        data = b"".join([(await self.get("rx_data", i)).to_bytes(4, "little") for i in range(2)])
        dlc, remote = info & 0xF, bool(word >> 30 & 1)
        count = 0 if remote else min(dlc, 8)
        assert not any(data[count:])
        frame = Frame(word & 0x1FFF_FFFF, bool(word >> 31), remote, dlc, data[:count])
        return frame, info >> 8 & 7, bool(info >> 16 & 1), await self.get("rx_time")

    async def take(self) -> tuple[Frame, int, bool, int]:
        entry = await self.oldest()
        await self.set("rx_command", 1)
        await self.clocks()
        return entry

    async def events(self) -> tuple[int, int]:
        """What has happened since the last call, which is cleared, and the pulses of event_o."""
        seen, pulses = await self.get("events"), self.pulses
        await self.set("events", seen)
        assert await self.get("events") == 0
        self.pulses = 0
        return seen, pulses


@cocotb.test
async def frames_both_ways(dut: Any) -> None:
    """Random frames from each buffer arrive at the node as they were written; the node's are read with their stamps.

    Verifies: CAN-22
    """
    rng = random.Random(random.randrange(1 << 32))
    tb = TB(dut)
    node = tb.wire.node(0.001, 3.0)
    await tb.begin()
    mine = [Frame.draw(rng) for _ in range(18)]
    for i, frame in enumerate(mine):
        await tb.put(i % 3, frame, rng.randrange(4))
        await tb.quiet()
    assert node.mac.received == mine
    # The most urgent first, while a frame on the bus holds up the others.
    order = [Frame(0x1), Frame(0x2), Frame(0x3)]
    await tb.put(0, order[0])
    await tb.bits(5)
    await tb.put(1, order[2], 1)
    await tb.put(2, order[1], 2)
    assert await tb.get("status") & 7 == 7
    await tb.quiet()
    assert node.mac.received[18:] == order
    for frame in (Frame.draw(rng) for _ in range(12)):
        stamp = rng.getrandbits(32)
        dut.now_i.value = stamp
        node.mac.queue.append(frame)
        await tb.quiet()
        assert await tb.get("status") & 0x10
        assert await tb.take() == (frame, 0, False, stamp)
        assert await tb.get("status") & 0x10 == 0
        words = [await tb.get(name) for name in ("rx_id", "rx_info", "rx_time", "rx_data")]
        assert not any(words), f"an empty FIFO shows {words}"
        await tb.set("rx_command", 1)
    assert not node.mac.faults and await tb.get("error") == 0


@cocotb.test
async def each_filter(dut: Any) -> None:
    """Each filter takes its frame and none that differs in a bit, the format or the kind.

    Verifies: CAN-22
    """
    rng = random.Random(random.randrange(1 << 32))
    tb = TB(dut)
    node = tb.wire.node()
    await tb.begin(accept=False)
    frames = []
    for x in range(8):
        ext = rng.random() < 0.5
        frame = Frame(8 * rng.getrandbits(26 if ext else 8) + x, ext, rng.random() < 0.5)
        await tb.set("filter_id", name_word(frame), x)
        await tb.set("filter_mask", 0x1FFF_FFFF | FILTER_ENABLE | KINDS, x)
        frames.append(frame)
    for x in rng.sample(range(8), 8):
        frame = frames[x]
        width = 29 if frame.ext else 11
        others = [
            replace(frame, id=frame.id ^ 1 << rng.randrange(3, width)),
            replace(frame, rtr=not frame.rtr),
            replace(frame, ext=not frame.ext, id=frame.id & 0x7FF),
        ]
        node.mac.queue.extend([*others, frame])
        await tb.quiet()
        assert (await tb.take())[:2] == (frame, x)
        assert await tb.get("status") & 0x10 == 0


@cocotb.test
async def events_and_interrupt(dut: Any) -> None:
    """Each kind sets its own bit, pulses event_o where its mask is 1, and is cleared by writing 1.

    Verifies: CAN-23
    """
    rng = random.Random(random.randrange(1 << 32))
    tb = TB(dut)
    node = tb.wire.node()
    await tb.begin()
    for enabled in (False, True):
        x = rng.randrange(3)
        await tb.set("event_enable", enabled * (SENT << x | REFUSED << x | ABORTED << x))
        await tb.put(x, Frame(0x55))
        await tb.bits(3)
        await tb.put(x, Frame(0x56))
        await tb.clocks(3)
        assert await tb.events() == (REFUSED << x, enabled)
        await tb.quiet()
        assert await tb.events() == (SENT << x, enabled)
        # The frame of another buffer holds the bus meanwhile.
        other = (x + 1) % 3
        await tb.put(other, Frame(0x1))
        await tb.bits(3)
        await tb.put(x, Frame(0x57))
        await tb.set("tx_command", 0x10 << x)
        await tb.quiet()
        assert await tb.events() == (ABORTED << x | SENT << other, enabled)
    await tb.set("event_enable", RECEIVED)
    node.mac.queue.extend(Frame(i) for i in range(35))
    await tb.quiet()
    assert await tb.events() == (RECEIVED | OVERRUN, 32)
    assert await tb.get("status") >> 24 == 3
    for i in range(32):
        assert (await tb.take())[0].id == i
    await tb.set("event_enable", OVERRUN)
    node.mac.queue.append(Frame(0x77))
    await tb.quiet()
    assert (await tb.take())[2], "the loss is told with the next frame"
    assert await tb.events() == (RECEIVED, 0)
    # Nobody acknowledges: an error a time; state changes at 96 and at 128.
    tb.wire.bus.nodes.remove(node)
    node.port.drive(get_sim_time("ns"), 1)
    await tb.set("event_enable", STATE)
    await tb.put(0, Frame(0x7))
    await tb.bits(3000)
    assert await tb.events() == (ERROR | STATE, 2)
    assert await tb.get("error") == ACK_ERROR
    status = await tb.get("status")
    assert status & (WARNING | PASSIVE | BUS_OFF) == WARNING | PASSIVE and status >> 8 & 0xFF == 128
    # A clear in the clock of an event leaves it, one clock later takes it.
    await tb.set("event_enable", 0)
    left = []
    for wait in range(4):
        await tb.set("events", 0x7FFF)
        await tb.set("tx_command", 1)
        await tb.clocks(wait)
        await tb.set("events", REFUSED | SENT)
        left.append(await tb.get("events") & REFUSED)
        await tb.clocks(3)
        assert await tb.get("events") & REFUSED == (REFUSED if wait < 2 else 0)
    assert left == [0, REFUSED, 0, 0]


@cocotb.test
async def modes_and_recovery(dut: Any) -> None:
    """Listening, looping back, disabled; bus-off that is left only if that is allowed.

    Verifies: CAN-24
    """
    tb = TB(dut)
    node = tb.wire.node()
    await tb.begin(ENABLE | LISTEN | RECOVER)
    node.mac.queue.append(Frame(0x123))
    await tb.bits(120)
    assert node.mac.faults == [Fault.ACK] * len(node.mac.faults) and len(node.mac.faults) > 1
    await tb.set("control", ENABLE | LOOPBACK | RECOVER)  # not before it is disabled
    await tb.bits(200)
    assert await tb.get("status") & 0xFFFF_00E7 == 0 and tb.wire.edges == [0]
    node.mac.queue.clear()
    await tb.bits(200)
    await tb.set("control", LOOPBACK | RECOVER)
    await tb.bits(5)
    await tb.set("control", ENABLE | LOOPBACK | RECOVER)
    await tb.put(1, Frame(0x42, dlc=1, data=b"x"))
    await tb.quiet()
    while (await tb.oldest())[0].id == 0x123:
        await tb.take()
    assert (await tb.take())[0] == Frame(0x42, dlc=1, data=b"x") and tb.wire.edges == [0]
    # Its dominant bits do not reach the bus.
    await tb.set("control", 0)
    await tb.clocks(3)
    await tb.set("control", ENABLE)
    tb.wire.bus.force(0, 1e9, 1)
    await tb.put(0, Frame(0x7))
    await tb.bits(800)
    status = await tb.get("status")
    assert status & BUS_OFF and await tb.get("error") == BIT_ERROR
    assert dut.tx_o.value == 1
    edges = tb.wire.edges[0]
    await tb.bits(130 * 11)
    assert await tb.get("status") & BUS_OFF and tb.wire.edges == [edges]
    await tb.set("control", ENABLE | RECOVER)
    await tb.bits(128 * 11 - 12)
    assert await tb.get("status") & BUS_OFF and tb.wire.edges == [edges]
    await tb.bits(13)
    assert await tb.get("status") & BUS_OFF == 0


def test_fl_can_wb() -> None:
    """The wrapper."""
    run_block_test("fl_can_wb", ["soc/fl_bus_pkg.sv", *CAN_SOURCES, "soc/fl_can_wb.sv"], __name__, registers=["can"])
