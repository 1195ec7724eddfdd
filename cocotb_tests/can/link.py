# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The pins of controllers on a bus model in continuous time. Python wakes at edges and ends of bits only."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, inf
from typing import Any

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import Event, FallingEdge, First, Lock, Timer
from cocotb.utils import get_sim_time

from cocotb_tests.can.bench import CLOCK_NS, pack, unpack
from fluxlock.can.bus import Bus, Node
from fluxlock.can.frame import Frame
from fluxlock.can.timing import BitTiming

ACCEPT_ALL = 1 << 62


@dataclass(frozen=True)
class Entry:
    """A frame as it came out of a receive FIFO."""

    frame: Frame
    stamp: int
    filter: int
    lost: bool


def filters(*words: int) -> int:
    """The filters' settings, the first filter lowest."""
    return sum(word << 63 * i for i, word in enumerate(words))


def accept(identifier: int = 0, mask: int = 0, ext: bool | None = None, rtr: bool | None = None) -> int:
    """A `can_filter_t`; None matches both."""
    kinds = (ext is not None) << 61 | bool(ext) << 60 | (rtr is not None) << 59 | bool(rtr) << 58
    return ACCEPT_ALL | kinds | mask << 29 | identifier


class Wire:
    """A bus model on the pins `rx_i` and `tx_o` of one or more controllers, a bit each."""

    def __init__(self, dut: Any, timing: BitTiming, count: int, delay_ns: float = 0.0) -> None:
        self.dut, self.timing = dut, timing
        self.bus = Bus()
        self.levels = self.tx = (1 << count) - 1  # on the controllers' inputs, their outputs
        self.ports = [self.bus.port(delay_ns, lambda now, level, x=x: self._deliver(x, level)) for x in range(count)]  # type: ignore[misc]
        self.armed = inf
        self.edges = [0] * count  # of the controllers' outputs

    @property
    def bit_ns(self) -> float:
        return self.timing.bit_cycles * CLOCK_NS

    def node(self, clock_error: float = 0.0, delay_ns: float = 0.0, start_ns: float = 0.0) -> Node:
        """An independent node, on from now; its clock is fast by the error."""
        quantum_ns = self.timing.brp * CLOCK_NS / (1 + clock_error)
        return self.bus.node(self.timing, quantum_ns, delay_ns, get_sim_time("ns") + start_ns)

    def join(self) -> None:
        """From now on the pins are on the bus; the outputs must be recessive."""
        cocotb.start_soon(self._watch())
        cocotb.start_soon(self._sleep())

    def _deliver(self, x: int, level: int) -> None:
        self.levels = self.levels & ~(1 << x) | level << x
        self.dut.rx_i.value = self.levels

    async def _watch(self) -> None:
        while True:
            await self.dut.tx_o.value_change
            now = float(get_sim_time("ns"))
            self.bus.run(now)
            tx = int(self.dut.tx_o.value)
            for x, port in enumerate(self.ports):
                if (tx ^ self.tx) >> x & 1:
                    self.edges[x] += 1
                    port.drive(now, tx >> x & 1)
            self.tx = tx
            self.bus.run(now)
            if self.bus.wake_at < self.armed:
                cocotb.start_soon(self._early())

    async def _early(self) -> None:
        """An edge came in while the bus slept for longer."""
        now = float(get_sim_time("ns"))
        await Timer(max(1, ceil(self.bus.wake_at - now)), "ns")
        self.bus.run(float(get_sim_time("ns")))
        if self.bus.wake_at < self.armed:
            cocotb.start_soon(self._early())

    async def _sleep(self) -> None:
        while True:
            now = float(get_sim_time("ns"))
            self.bus.run(now)
            self.armed = min(self.bus.wake_at, now + 10 * self.bit_ns)
            await Timer(max(1, ceil(self.armed - now)), "ns")

    async def bits(self, count: float) -> None:
        await Timer(round(count * self.bit_ns), "ns")


class Link(Wire):
    """Two controllers of `fl_can_bench` with clock and bus. `received[x]` fills by itself while `reading[x]`."""

    def __init__(self, dut: Any, timing: BitTiming, delay_ns: float = 0.0) -> None:
        super().__init__(dut, timing, 2, delay_ns)
        self.putting = Lock()  # both controllers share the lines
        self.received: list[list[Entry]] = [[], []]
        self.reading = [True, True]
        self.resumed = Event()

    async def start(self, filter_word: int = ACCEPT_ALL, **inputs: int) -> None:
        dut = self.dut
        Clock(dut.clk_i, CLOCK_NS, unit="ns").start()
        idle = ("listen_i", "loopback_i", "put_i", "put_frame_i", "put_priority_i", "abort_i", "rx_pop_i")
        values = dict.fromkeys(idle, 0) | {"enable_i": 0b11} | inputs
        for name, value in values.items():
            getattr(dut, name).value = value
        dut.rx_i.value, dut.timing_i.value, dut.filter_i.value = 0b11, self.timing.packed, filter_word
        dut.rst_i.value = 1
        await FallingEdge(dut.clk_i)
        await Timer(3 * CLOCK_NS, "ns")
        dut.rst_i.value = 0
        self.zero_ns = get_sim_time("ns")  # when the time stamps' clock was 0
        self.join()
        cocotb.start_soon(self._read())

    async def _read(self) -> None:
        dut = self.dut
        while True:
            valid = int(dut.rx_valid_o.value) & sum(on << x for x, on in enumerate(self.reading))
            if not valid:
                await First(dut.rx_valid_o.value_change, self.resumed.wait())
                self.resumed.clear()
            await FallingEdge(dut.clk_i)
            valid = int(dut.rx_valid_o.value) & sum(on << x for x, on in enumerate(self.reading))
            entries = int(dut.rx_entry_o.value)
            for x in range(2):
                if valid >> x & 1:
                    word = entries >> 135 * x & (1 << 135) - 1
                    frame = unpack(word & (1 << 99) - 1)
                    stamp, number = word >> 99 & 0xFFFF_FFFF, word >> 131 & 7
                    self.received[x].append(Entry(frame, stamp, number, bool(word >> 134)))
            dut.rx_pop_i.value = valid
            await FallingEdge(dut.clk_i)
            dut.rx_pop_i.value = 0

    def read_on(self, x: int) -> None:
        """Read a FIFO again that was left alone."""
        self.reading[x] = True
        self.resumed.set()

    async def pulse(self, name: str, value: int) -> None:
        """One clock of a strobe."""
        await FallingEdge(self.dut.clk_i)
        getattr(self.dut, name).value = value
        await FallingEdge(self.dut.clk_i)
        getattr(self.dut, name).value = 0

    async def put(self, x: int, buffer: int, frame: Frame, priority: int = 0) -> None:
        """A frame into a transmit buffer of a controller."""
        async with self.putting:
            self.dut.put_frame_i.value, self.dut.put_priority_i.value = pack(frame), priority
            await self.pulse("put_i", 1 << (3 * x + buffer))

    async def send(self, x: int, frames: Sequence[Frame]) -> None:
        """Frames one after the other through buffer 0."""
        for frame in frames:
            await self.put(x, 0, frame)
            while int(self.dut.pending_o.value) >> 3 * x & 1:
                await self.dut.pending_o.value_change

    async def rest(self, limit_bits: int = 100_000) -> None:
        """Until nothing waits to be sent, and a little longer."""
        for _ in range(limit_bits // 20):
            await self.bits(20)
            waiting = int(self.dut.pending_o.value) or any(node.mac.queue for node in self.bus.nodes)
            if not waiting:
                await self.bits(20)
                return
        raise AssertionError("frames still wait")

    def counts(self, x: int) -> tuple[int, int]:
        """Transmit and receive error counter."""
        word = int(self.dut.counts_o.value) >> 16 * x
        return word & 0xFF, word >> 8 & 0xFF
