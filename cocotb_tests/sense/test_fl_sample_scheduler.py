# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Sample scheduler: spacing and alignment of the strobes in every mode.

The oracle lists the strobes that a sequence of carrier starts must give, from start to start.
"""

from __future__ import annotations

import random
from itertools import pairwise
from typing import Any

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge

from fluxlock.cosim.block import run_block_test

OFF, CONTINUOUS, CARRIER, ONCE = range(4)
START_TO_STROBE = 1  # clocks, published by the module


class TB:
    """Clock by clock: carrier starts in, clock numbers of the strobes out."""

    def __init__(self, dut: Any) -> None:
        self.dut = dut
        self.clock = 0

    async def start(self, mode: int, period: int, offset: int) -> None:
        dut = self.dut
        Clock(dut.clk_i, 20, unit="ns").start()
        dut.rst_i.value = 1
        dut.carrier_start_i.value = 0
        self.configure(mode, period, offset)
        for _ in range(3):
            await FallingEdge(dut.clk_i)
        dut.rst_i.value = 0
        self.clock = 0

    def configure(self, mode: int, period: int, offset: int) -> None:
        self.dut.cfg_mode_i.value = mode
        self.dut.cfg_period_i.value = period
        self.dut.cfg_offset_i.value = offset

    async def run(self, clocks: int, starts: set[int]) -> list[int]:
        """Strobes of the next clocks; a carrier starts in the clocks of `starts`."""
        strobes = []
        for _ in range(clocks):
            await FallingEdge(self.dut.clk_i)
            self.clock += 1
            self.dut.carrier_start_i.value = int(self.clock in starts)
            if int(self.dut.strobe_o.value):
                strobes.append(self.clock)
        return strobes


def gaps(strobes: list[int]) -> list[int]:
    return [b - a for a, b in pairwise(strobes)]


@cocotb.test()
@cocotb.parametrize(period=[0, 15, 16, 17, 50, 333])
async def continuous_has_the_period(dut: Any, period: int) -> None:
    """A strobe every period exactly, never closer than 16 clocks, whatever the carrier does.

    Verifies: SENSE-01
    """
    tb = TB(dut)
    await tb.start(CONTINUOUS, period, 7)
    strobes = await tb.run(4000, set(range(3, 4000, 111)))
    assert len(strobes) >= 11
    assert set(gaps(strobes)) == {max(period, 16)}


@cocotb.test()
async def off_is_silent(dut: Any) -> None:
    """No strobe in mode OFF, and none is left over from the mode before.

    Verifies: SENSE-01
    """
    tb = TB(dut)
    await tb.start(OFF, 50, 0)
    assert await tb.run(500, {10, 200}) == []
    tb.configure(CONTINUOUS, 50, 0)
    assert len(await tb.run(500, set())) == 10
    tb.configure(OFF, 50, 0)
    assert await tb.run(500, {1100, 1200}) == []


def expected_carrier(starts: list[int], end: int, period: int, offset: int, first: int) -> list[int]:
    """Strobes of mode CARRIER: the grid from each restart, silent where it would delay the next restart."""
    strobes = [first]
    while strobes[-1] + period <= starts[0]:  # before the first start: plain grid
        strobes.append(strobes[-1] + period)
    for start, following in zip(starts, [*starts[1:], end], strict=True):
        wanted = start + START_TO_STROBE + offset
        limit = following + START_TO_STROBE  # from here on the next start decides
        while max(strobes[-1] + period, start + START_TO_STROBE) + period <= wanted:
            strobes.append(max(strobes[-1] + period, start + START_TO_STROBE))
            if strobes[-1] >= limit:
                strobes.pop()
                break
        restart = max(wanted, strobes[-1] + period)
        if restart >= limit:
            continue
        strobes.append(restart)
        while strobes[-1] + period < limit:
            strobes.append(strobes[-1] + period)
    return [s for s in strobes if s <= end]


@cocotb.test()
@cocotb.parametrize(period=[16, 37, 50, 64], offset=[0, 10, 36, 50, 75, 150, 180])
async def carrier_restarts_the_grid(dut: Any, period: int, offset: int) -> None:
    """CARRIER mode: restart at offset after every start, spacing kept, exact where offset >= period.

    Verifies: SENSE-02, SENSE-03
    """
    rng = random.Random(period * 1000 + offset)
    tb = TB(dut)
    await tb.start(CARRIER, period, offset)
    starts = [rng.randrange(20, 200)]
    while starts[-1] < 9000:
        starts.append(starts[-1] + rng.choice([250, 250, 250, rng.randrange(offset + 2, 700)]))
    starts.pop()
    got = await tb.run(9000, set(starts))
    assert min(gaps(got)) >= period
    expected = expected_carrier(starts, 9000, period, offset, got[0])
    assert got == expected, f"missing {sorted({*expected} - {*got})}, too many {sorted({*got} - {*expected})}"
    if offset >= period:
        exact = {s + START_TO_STROBE + offset for s in starts if s + START_TO_STROBE + offset <= 9000}
        assert exact <= set(got), f"missed restarts: {sorted(exact - set(got))}"


@cocotb.test()
@cocotb.parametrize(offset=[0, 1, 49, 120, 300])
async def once_a_carrier(dut: Any, offset: int) -> None:
    """ONCE mode: one strobe a carrier at its offset; a carrier shorter than the offset gives none.

    Verifies: SENSE-02
    """
    rng = random.Random(offset)
    tb = TB(dut)
    await tb.start(ONCE, 50, offset)
    starts = [30]
    while starts[-1] < 8000:
        starts.append(starts[-1] + rng.randrange(100, 600))
    starts.pop()
    got = await tb.run(8000, set(starts))
    ends = [*starts[1:], 8000]
    assert got == [s + START_TO_STROBE + offset for s, end in zip(starts, ends, strict=True) if s + offset < end]


@cocotb.test()
async def once_keeps_the_spacing(dut: Any) -> None:
    """Carriers shorter than the period: a strobe waits until the converter is free.

    Verifies: SENSE-03
    """
    tb = TB(dut)
    await tb.start(ONCE, 50, 0)
    got = await tb.run(3000, set(range(10, 3000, 30)))
    assert min(gaps(got)) == 50


def test_fl_sample_scheduler() -> None:
    """Sample scheduler block test."""
    run_block_test("fl_sample_scheduler", ["sense/fl_sample_scheduler.sv"], __name__)
