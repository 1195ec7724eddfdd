# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Hall sensors: decoding both ways, filter, stamps to the clock, invalid and skipped codes, phase against crossings."""

from __future__ import annotations

import random
from typing import Any

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, Timer

from fluxlock.cosim.block import run_block_test

CLOCK_NS = 20
MASK32 = 0xFFFFFFFF
LATENCY = 3  # clocks from pin to valid_o besides the filter, published by the module
SATURATED = (1 << 24) - 1
# e_A > e_B, e_B > e_C, e_C > e_A over theta' = 30..90, 90..150, ... degrees: bits A, B, C.
CODES = (0b001, 0b011, 0b010, 0b110, 0b100, 0b101)
DEFAULT_MAP = (7, 0, 2, 1, 4, 5, 3, 7)


class TB:
    """Drives pins at chosen clocks; `now` is the time of the present clock."""

    def __init__(self, dut: Any) -> None:
        self.dut = dut
        self.now = 0
        self.edges: list[tuple[int, int, int, int, int]] = []  # seen at, time, sector, backward, single
        self.invalid: list[int] = []

    async def start(self, pins: int = 0, filter_cycles: int = 20, table: tuple[int, ...] = DEFAULT_MAP) -> None:
        dut = self.dut
        self.now = random.randrange(1 << 32)
        dut.now_i.value = self.now
        dut.hall_i.value = pins
        dut.cfg_filter_i.value = filter_cycles
        dut.cfg_map_i.value = sum(s << (3 * i) for i, s in enumerate(table))
        dut.reverse_i.value = dut.zc_valid_i.value = dut.zc_time_i.value = 0
        dut.rst_i.value = 1
        Clock(dut.clk_i, CLOCK_NS, unit="ns").start()
        await FallingEdge(dut.clk_i)
        await Timer(3 * CLOCK_NS, "ns")
        dut.rst_i.value = 0
        await self.clocks(1)

    async def clocks(self, n: int) -> None:
        dut = self.dut
        for _ in range(n):
            await Timer(CLOCK_NS, "ns")
            self.now = (self.now + 1) & MASK32
            dut.now_i.value = self.now
            if int(dut.valid_o.value):
                self.edges.append(
                    (
                        self.now,
                        int(dut.time_o.value),
                        int(dut.sector_o.value),
                        int(dut.backward_o.value),
                        int(dut.single_o.value),
                    )
                )
            if int(dut.invalid_event_o.value):
                self.invalid.append(self.now)

    async def pins(self, code: int) -> int:
        """Change the pins in this clock; returns its time."""
        self.dut.hall_i.value = code
        return self.now


@cocotb.test()
@cocotb.parametrize(filter_cycles=[0, 1, 2, 50, 700], reverse=[0, 1])
async def edges_are_exact(dut: Any, filter_cycles: int, reverse: int) -> None:
    """Both ways round, with glitches and bouncing: sector, direction, stamp and latency to the clock.

    Verifies: HALL-01, HALL-02
    """
    rng = random.Random(filter_cycles + reverse)
    tb = TB(dut)
    least = max(filter_cycles, 1)
    region = rng.randrange(6)
    await tb.start(CODES[region], filter_cycles)
    dut.reverse_i.value = reverse
    await tb.clocks(least + 10)
    assert len(tb.edges) == 1 and tb.edges[0][4] == 0, "the first valid code is no step"
    assert int(dut.moved_o.value) == 0 and int(dut.ok_o.value) == 1
    for k in range(30):
        step = rng.choice([1, 1, 1, -1])
        old, region = region, (region + step) % 6
        for _ in range(rng.randrange(4)):  # bouncing, each state shorter than the filter
            if least > 1:
                await tb.pins(rng.choice([CODES[region], CODES[old] ^ (1 << rng.randrange(3))]))
                await tb.clocks(rng.randrange(1, least))
                await tb.pins(CODES[old])
                await tb.clocks(rng.randrange(1, least))
        count = len(tb.edges)
        at = await tb.pins(CODES[region])
        await tb.clocks(least + LATENCY - 1)
        assert len(tb.edges) == count, f"edge {k} before the filter has passed"
        await tb.clocks(1)
        sector = (region + 3 * reverse) % 6
        assert tb.edges[count:] == [(tb.now, at, sector, int(step < 0), 1)], f"edge {k} at {at}"
        assert int(dut.position_o.value) == region and int(dut.moved_o.value) == 1
        await tb.clocks(rng.randrange(1, 40) + least)
    assert len(tb.edges) == 31 and int(dut.edges_o.value) == 31 and int(dut.skipped_o.value) == 0
    assert tb.invalid == [] and int(dut.invalid_o.value) == 0


@cocotb.test()
async def invalid_and_skipped(dut: Any) -> None:
    """Invalid codes and jumps over a sector are counted; the sector stays with an invalid code.

    Verifies: HALL-03
    """
    tb = TB(dut)
    await tb.start(0b000, 5)
    await tb.clocks(20)
    assert tb.edges == [] and len(tb.invalid) == 1 and int(dut.ok_o.value) == 0
    for code, single in ((CODES[2], 0), (CODES[3], 1), (CODES[5], 0), (CODES[0], 1), (CODES[3], 0)):
        await tb.pins(code)
        await tb.clocks(20)
        assert tb.edges[-1][4] == single and tb.edges[-1][2] == CODES.index(code)
    assert int(dut.skipped_o.value) == 2 and int(dut.edges_o.value) == 5
    await tb.pins(0b111)
    await tb.clocks(20)
    assert int(dut.ok_o.value) == 0 and int(dut.sector_o.value) == 3 and int(dut.code_o.value) == 7
    await tb.pins(CODES[3])  # back to where it was: no edge
    await tb.clocks(20)
    assert int(dut.ok_o.value) == 1 and len(tb.edges) == 5
    await tb.pins(0b000)
    await tb.clocks(20)
    await tb.pins(CODES[4])
    await tb.clocks(20)
    assert tb.edges[-1][4] == 1, "a neighbour after an invalid code"
    assert int(dut.invalid_o.value) == 3 and len(tb.invalid) == 3 and int(dut.skipped_o.value) == 2


@cocotb.test()
async def any_wiring(dut: Any) -> None:
    """A map for swapped and inverted sensors decodes them.

    Verifies: HALL-01
    """
    table = [7] * 8
    swapped = [((c & 1) << 1 | (c >> 1 & 1) << 2 | c >> 2) ^ 0b010 for c in CODES]
    for sector, code in enumerate(swapped):
        table[code] = sector
    tb = TB(dut)
    await tb.start(swapped[0], 3, tuple(table))
    await tb.clocks(10)
    for k in range(1, 13):
        await tb.pins(swapped[k % 6])
        await tb.clocks(10)
        assert tb.edges[-1][2:] == (k % 6, 0, 1)


@cocotb.test()
async def phase_against_the_crossing(dut: Any) -> None:
    """The time from the last crossing to a sector's last edge, saturated without one.

    Verifies: HALL-04
    """
    tb = TB(dut)
    await tb.start(CODES[0], 4)

    def phases() -> list[int]:
        word = int(dut.phase_o.value)
        return [word >> (24 * i) & SATURATED for i in range(6)]

    await tb.clocks(20)
    await tb.pins(CODES[1])
    await tb.clocks(20)
    assert phases() == [SATURATED] * 6
    expected = [SATURATED] * 6
    for region in (2, 3, 4, 5, 0, 1, 2):
        crossing = (tb.now - 15) & MASK32
        dut.zc_time_i.value = crossing
        dut.zc_valid_i.value = 1
        await tb.clocks(1)
        dut.zc_valid_i.value = 0
        await tb.clocks(30 + region)
        at = await tb.pins(CODES[region])
        expected[region] = (at - crossing) & MASK32
        await tb.clocks(20)
        assert phases() == expected
    await tb.pins(CODES[4])
    await tb.clocks(20)
    expected[4] = SATURATED
    assert phases() == expected


def test_fl_hall() -> None:
    """Hall sensor block test."""
    run_block_test("fl_hall", ["common/fl_sync.sv", "zcd/fl_hall.sv"], __name__)
