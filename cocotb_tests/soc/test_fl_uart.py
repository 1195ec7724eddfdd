# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

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
DEPTH = 16  # of the transmit FIFO
BYTE, MARK, OPEN = 0x100, 0x200, 0x80


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
        """Frames back to back; the line is idle for what is left of the last clock only."""
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


async def take(bench: Bench) -> int | None:
    """The next word of the receive FIFO, None: it is empty."""
    word = await bench.read(RX)
    assert word & (BYTE | MARK) != BYTE | MARK and word >> 10 == 0, hex(word)
    return word if word & (BYTE | MARK) else None


async def drain(bench: Bench) -> bytes:
    """All bytes that wait; there must be no mark among them."""
    out = bytearray()
    while (word := await take(bench)) is not None:
        assert word & BYTE, hex(word)
        out.append(word & 0xFF)
    return bytes(out)


def read_lines(words: list[int]) -> list[bytes | None]:
    """What a reader of lines makes of bytes and marks, None: bytes of the line are missing. The contract, once more."""
    lines: list[bytes | None] = []
    text, hurt = bytearray(), False

    def end() -> None:
        if text.strip() or hurt:
            lines.append(None if hurt else bytes(text).strip())  # a blank line's end may be lost, its blanks not

    for word in words:
        if word & MARK:
            for _ in range(word & 0x7F):
                hurt = True
                end()
                text, hurt = bytearray(), False
            hurt = hurt or bool(word & OPEN)
        elif word & 0xFF in b"\r\n":
            end()
            text, hurt = bytearray(), False
        else:
            text.append(word & 0xFF)
    assert not text and not hurt, "behind the last line"
    return lines


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
async def receive_overrun_is_counted_and_marked(dut: Any) -> None:
    """The oldest bytes are kept; a mark tells of the others, in their place, and raises the event itself."""
    bench, line = await setup(dut, 8)
    depth = int(dut.RxDepth.value)
    kept = bytes(random.choices(range(0x20, 0x7F), k=depth))
    events = 0

    async def count() -> None:
        nonlocal events
        while True:
            await FallingEdge(dut.clk_i)
            events += int(dut.rx_event_o.value)

    cocotb.start_soon(count())
    for lost, ends, still_open in ((b"abc", 0, OPEN), (b"a\r\nb\n \t\n", 2, 0), (b"\n\nab\ncd", 2, OPEN)):
        events, before = 0, (await bench.read(STATUS)) >> 8 & 0xFF
        await line.send(kept + lost, 8 * CLOCK_NS)
        await bench.clocks(100)
        assert (await bench.read(STATUS)) >> 8 & 0xFF == before + len(lost)
        assert events == depth
        # The first word that is taken makes room for the mark; a byte after it has its place behind the mark.
        words = [await take(bench) for _ in range(3)]
        await bench.clocks(4)
        assert events == depth + 1
        await line.send(b"\n", 8 * CLOCK_NS)
        await bench.clocks(100)
        while (word := await take(bench)) is not None:
            words.append(word)
        assert words == [*(BYTE | c for c in kept), MARK | still_open | ends, BYTE | ord("\n")], lost
        assert await bench.read(STATUS) & RX_VALID == 0


@cocotb.test
async def second_end_right_after_a_kept_one_ends_no_line(dut: Any) -> None:
    """CR is kept and LF lost: nothing is missing, and the mark says so."""
    bench, line = await setup(dut, 8)
    depth = int(dut.RxDepth.value)
    await line.send(b"x" * (depth - 1) + b"\r\n", 8 * CLOCK_NS)
    await bench.clocks(100)
    words = [await take(bench) for _ in range(depth)]
    await bench.clocks(4)
    assert words[-1] == BYTE | ord("\r") and await take(bench) == MARK
    assert await take(bench) is None


@cocotb.test
async def lost_ends_saturate(dut: Any) -> None:
    bench, line = await setup(dut, 8)
    depth = int(dut.RxDepth.value)
    await line.send(b"x" * depth + b"y\n" * 140, 8 * CLOCK_NS)
    await bench.clocks(100)
    assert (await bench.read(STATUS)) >> 8 & 0xFF == 255
    for _ in range(depth):
        assert await take(bench) == BYTE | ord("x")
    await bench.clocks(4)
    assert await take(bench) == MARK | 127


@cocotb.test
@cocotb.parametrize(wrong_stops=[False, True])
async def every_line_arrives_whole_or_hurt(dut: Any, wrong_stops: bool) -> None:
    """Random lines, pauses of the sender and of the reader: as many lines come out as went in, each its own or hurt."""
    bench, line = await setup(dut, 8)
    depth = int(dut.RxDepth.value)
    lines = [bytes(random.choices(range(0x21, 0x7F), k=random.randint(1, 24))) for _ in range(150)]
    damaged: set[int] = set()
    words: list[int] = []
    sending = True

    async def sender() -> None:
        nonlocal sending
        for n, text in enumerate(lines):
            wrong = random.randrange(len(text)) if wrong_stops and random.random() < 0.2 else None
            for i, byte in enumerate(text):
                await line.send(bytes([byte]), 8 * CLOCK_NS, stop=int(i != wrong))
                if i == wrong:
                    damaged.add(n)
                    await Timer(3 * 8 * CLOCK_NS, "ns")  # the line is idle before the next start bit
            await line.send(random.choice([b"\n", b"\r", b"\r\n", b"\n \t \n"]), 8 * CLOCK_NS)
            if random.random() < 0.3:
                await Timer(random.randint(0, 40 * depth) * CLOCK_NS, "ns")
        sending = False

    cocotb.start_soon(sender())
    while True:
        # Steps of every length, so that a word is taken in each clock around the arrival of a byte.
        await bench.clocks(random.choice([1, random.randint(1, 60), random.randint(1, 60), 100 * depth]))
        done = not sending
        if done:
            await bench.clocks(200)
        for _ in range(random.randint(1, 2 * depth) if not done else 4 * depth):
            word = await take(bench)
            if word is None:
                break
            words.append(word)
        if done:
            break
    got = read_lines(words)
    assert len(got) == len(lines), f"{len(lines)} lines sent, {len(got)} seen"
    status = await bench.read(STATUS)
    overrun = status >> 8 & 0xFF
    hurt = {n for n, text in enumerate(got) if text is None}
    for n, text in enumerate(got):
        assert text in (None, lines[n]), f"line {n}: {text!r} for {lines[n]!r}"
    assert damaged <= hurt, f"shortened unseen: {sorted(damaged - hurt)}"
    assert status >> 16 & 0xFF == len(damaged)
    assert len(hurt - damaged) <= overrun
    dut._log.info("%d lines, %d hurt, %d by a stop bit, %d bytes overrun", len(lines), len(hurt), len(damaged), overrun)
    if depth <= 16:
        assert overrun > 50 and 10 < len(hurt - damaged) < 140


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
    assert await take(bench) == MARK | OPEN
    assert await drain(bench) == b"ok"


@cocotb.test
async def bit_times_below_eight_are_eight(dut: Any) -> None:
    bench, line = await setup(dut, 3)
    await bench.write(TX, 0xA6)
    await bench.clocks(100)
    assert line.decode(8) == b"\xa6"


@pytest.mark.parametrize(("seed", "rx_depth"), [(1, 128), (2, 16)])
def test_fl_uart(seed: int, rx_depth: int) -> None:
    """Frames, bit times, FIFOs, counters, marks of lost bytes and events of the UART.

    Verifies: SOC-07, SOC-08, SOC-30
    """
    names = ("fl_bus_pkg", "fl_uart_rx", "fl_uart_tx", "fl_uart", "fl_uart_wb")
    run_block_test(
        "fl_uart_wb",
        ["common/fl_sync.sv", "common/fl_fifo.sv", *(f"soc/{name}.sv" for name in names)],
        __name__,
        parameters={"RxDepth": rx_depth},
        registers=["uart"],
        seed=seed,
    )
