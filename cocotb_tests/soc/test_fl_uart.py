"""UART against an independent serial coder and decoder."""

from __future__ import annotations

import random
from typing import Any

import cocotb
import pytest
from cocotb.triggers import FallingEdge, Timer

from cocotb_tests.soc.bench import CLOCK_NS, Bench
from fluxlock.cosim.block import run_block_test

BIT_TIME, TX, RX, STATUS = range(0, 0x10, 4)
TX_READY, RX_VALID, TX_IDLE = 1, 2, 4
DEPTH = 16


class Line:
    """Levels of tx_o clock by clock, and a sender for rx_i with its own bit time in ns."""

    def __init__(self, dut: Any) -> None:
        self.dut = dut
        self.levels: list[int] = []
        cocotb.start_soon(self._record())

    async def _record(self) -> None:
        while True:
            await FallingEdge(self.dut.clk_i)
            self.levels.append(int(self.dut.tx_o.value))

    def decode(self, bit: int) -> bytes:
        """Bytes on tx_o; every level of every frame must last a whole number of bits, to the clock."""
        out, at = bytearray(), 0
        while 0 in self.levels[at:]:
            at = self.levels.index(0, at)
            frame = [self.levels[at + bit * i : at + bit * (i + 1)] for i in range(10)]
            assert all(len(set(level)) == 1 for level in frame[:9]), f"edge inside a bit at {at}"
            assert frame[0][0] == 0 and set(frame[9]) == {1}, f"start or stop bit at {at}"
            out.append(sum(frame[i + 1][0] << i for i in range(8)))
            at += 10 * bit
        return bytes(out)

    async def send(self, data: bytes, bit_ns: float, stop: int = 1) -> None:
        sent_ns = 0
        for n, byte in enumerate(data):
            for i, level in enumerate([0, *((byte >> i) & 1 for i in range(8)), stop]):
                self.dut.rx_i.value = level
                until = round((n * 10 + i + 1) * bit_ns)
                await Timer(until - sent_ns, "ns")
                sent_ns = until
        self.dut.rx_i.value = 1


async def setup(dut: Any, bit: int) -> tuple[Bench, Line]:
    bench = Bench(dut)
    await bench.start(rx_i=1)
    line = Line(dut)
    await bench.write(BIT_TIME, bit)
    return bench, line


async def drain(bench: Bench) -> bytes:
    out = bytearray()
    while (word := await bench.read(RX)) & 0x100:
        out.append(word & 0xFF)
        assert word >> 9 == 0
    return bytes(out)


@cocotb.test
@cocotb.parametrize(bit=[8, 11, 50])
async def transmits(dut: Any, bit: int) -> None:
    bench, line = await setup(dut, bit)
    assert await bench.read(STATUS) == TX_READY | TX_IDLE
    data = bytes([0x00, 0xFF, 0x55, 0xAA, *random.randbytes(12)])
    events = 0
    for byte in data:
        await bench.write(TX, byte)
    assert not await bench.read(STATUS) & TX_IDLE
    for _ in range(len(data) * 10 * bit + 20):
        events += int(dut.tx_event_o.value)
        await bench.clocks()
    assert await bench.read(STATUS) == TX_READY | TX_IDLE
    assert line.decode(bit) == data
    assert events == 1, f"{events} transmit events for one burst"
    # Frames follow each other without a gap.
    assert len(line.levels) - line.levels[::-1].index(0) - line.levels.index(0) <= len(data) * 10 * bit


@cocotb.test
async def transmit_fifo_drops_and_counts(dut: Any) -> None:
    bench, line = await setup(dut, 8)
    data = bytes(range(1, DEPTH + 6))
    for byte in data:
        await bench.write(TX, byte)
    await bench.clocks()
    status = await bench.read(STATUS)
    # One byte had left for the shift register.
    assert status >> 24 == len(data) - DEPTH - 1 and not status & TX_READY, hex(status)
    await bench.clocks((DEPTH + 2) * 80)
    assert line.decode(8) == data[: DEPTH + 1]


@cocotb.test
@cocotb.parametrize(bit=[8, 50], drift=[-0.03, 0.0, 0.03])
async def receives(dut: Any, bit: int, drift: float) -> None:
    """A sender 3 % off, each frame alone and frames back to back."""
    bench, line = await setup(dut, bit)
    data = bytes([0x00, 0xFF, 0x55, 0xAA, *random.randbytes(8)])
    await line.send(data, bit * CLOCK_NS * (1 + drift))
    await Timer(10 * bit * CLOCK_NS, "ns")
    await FallingEdge(dut.clk_i)
    assert await bench.read(STATUS) == TX_READY | TX_IDLE | RX_VALID
    assert await drain(bench) == data
    assert await bench.read(STATUS) == TX_READY | TX_IDLE


@cocotb.test
async def receive_overrun_is_counted_and_keeps_the_oldest(dut: Any) -> None:
    bench, line = await setup(dut, 8)
    data = random.randbytes(DEPTH + 3)
    events = 0

    async def count() -> None:
        nonlocal events
        while True:
            await FallingEdge(dut.clk_i)
            events += int(dut.rx_event_o.value)

    cocotb.start_soon(count())
    await line.send(data, 8 * CLOCK_NS)
    await Timer(100 * CLOCK_NS, "ns")
    await FallingEdge(dut.clk_i)
    assert (await bench.read(STATUS)) >> 8 & 0xFF == 3
    assert await drain(bench) == data[:DEPTH]
    assert events == DEPTH


@cocotb.test
async def glitch_and_frame_error(dut: Any) -> None:
    bench, line = await setup(dut, 20)
    # Shorter than half a bit: not a start bit.
    dut.rx_i.value = 0
    await bench.clocks(8)
    dut.rx_i.value = 1
    await bench.clocks(20 * 12)
    assert await bench.read(STATUS) == TX_READY | TX_IDLE
    # A wrong stop bit loses that frame only; a break counts once.
    await line.send(b"\x5a", 20 * CLOCK_NS, stop=0)
    dut.rx_i.value = 0
    await Timer(40 * 20 * CLOCK_NS, "ns")
    dut.rx_i.value = 1
    await Timer(4 * 20 * CLOCK_NS, "ns")
    await line.send(b"ok", 20 * CLOCK_NS)
    await Timer(100 * CLOCK_NS, "ns")
    await FallingEdge(dut.clk_i)
    assert (await bench.read(STATUS)) >> 16 & 0xFF == 1
    assert await drain(bench) == b"ok"


@cocotb.test
async def bit_times_below_eight_are_eight(dut: Any) -> None:
    bench, line = await setup(dut, 3)
    await bench.write(TX, 0xA6)
    await bench.clocks(100)
    assert line.decode(8) == b"\xa6"


@pytest.mark.parametrize("seed", [1])
def test_fl_uart(seed: int) -> None:
    """Frames, bit times, FIFOs, counters and events of the UART.

    Verifies: SOC-07, SOC-08
    """
    names = ("fl_bus_pkg", "fl_fifo", "fl_uart_rx", "fl_uart_tx", "fl_uart", "fl_uart_wb")
    run_block_test(
        "fl_uart_wb",
        ["safety/fl_sync.sv", *(f"soc/{name}.sv" for name in names)],
        __name__,
        registers=["uart"],
        seed=seed,
    )
