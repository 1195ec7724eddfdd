# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Freewheel measurement against straight current decays whose end is known."""

from __future__ import annotations

import math
import random
from dataclasses import dataclass, field
from typing import Any

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, Timer

from cocotb_tests.zcd.zcd_bench import FLOATING, MASK32
from fluxlock.cosim.block import run_block_test

CLOCK_NS = 20
OPEN = (1 << 24) - 1
DIRECT_LATENCY, INTERPOLATED_LATENCY = 5, 23  # clocks, published by the module


@dataclass
class TB:
    """Time runs with the clock; samples carry stamps of their own."""

    dut: Any
    now: int = 0
    results: list[tuple[int, int, bool]] = field(default_factory=list)  # cycles, sector, open

    async def start(self, limit: int = 500) -> None:
        dut = self.dut
        for name in ("update_i", "comm_applied_i", "sample_valid_i", "tick_i", "sector_i", "sample_sector_i"):
            getattr(dut, name).value = 0
        dut.cfg_enable_i.value = 1
        dut.cfg_limit_i.value = limit
        dut.now_i.value = self.now
        dut.rst_i.value = 1
        Clock(dut.clk_i, CLOCK_NS, unit="ns").start()
        await FallingEdge(dut.clk_i)
        await Timer(3 * CLOCK_NS, "ns")
        dut.rst_i.value = 0
        await self.clocks(1)
        dut.update_i.value = 1
        await self.clocks(1)
        dut.update_i.value = 0

    async def clocks(self, n: int) -> None:
        dut = self.dut
        for _ in range(n):
            await Timer(CLOCK_NS, "ns")
            self.now = (self.now + 1) & MASK32
            dut.now_i.value = self.now
            if int(dut.done_o.value):
                self.results.append(
                    (int(dut.last_cycles_o.value), int(dut.last_sector_o.value), bool(int(dut.last_open_o.value)))
                )

    async def commutate(self, sector: int) -> int:
        """First clock of a new sector; returns the instant at which the gates change."""
        self.dut.sector_i.value = sector
        self.dut.comm_applied_i.value = 1
        at = self.now + 1
        await self.clocks(1)
        self.dut.comm_applied_i.value = 0
        return at

    async def sample(self, time: int, sector: int, current: int, wait: int = 28) -> None:
        dut = self.dut
        channels = [random.randrange(-131072, 131072) for _ in range(9)]
        channels[3 + FLOATING[sector]] = current
        dut.sample_i.value = sum((v & 0x3FFFF) << (18 * i) for i, v in enumerate(channels))
        dut.sample_time_i.value = time & MASK32
        dut.sample_sector_i.value = sector
        dut.sample_valid_i.value = 1
        await self.clocks(1)
        dut.sample_valid_i.value = 0
        dut.sample_i.value = 0
        await self.clocks(wait)

    async def snapshot(self) -> dict[str, int]:
        self.dut.tick_i.value = 1
        await self.clocks(1)
        self.dut.tick_i.value = 0
        return {n: int(getattr(self.dut, f"snap_{n}_o").value) for n in ("sum", "max", "max_sector", "count", "open")}


@cocotb.test()
@cocotb.parametrize(seed=list(range(4)))
async def decay_is_timed(dut: Any, seed: int) -> None:
    """Straight decays through the limit: exact to rounding where the line is straight, statistics complete.

    Verifies: FRW-01, FRW-02
    """
    rng = random.Random(seed)
    tb = TB(dut, now=rng.choice([0, (1 << 32) - 20_000]))
    limit = rng.choice([0, 100, 3000])
    await tb.start(limit)
    values: list[tuple[int, int]] = []
    opened = 0
    for k in range(80):
        sector = rng.randrange(6)
        comm = await tb.commutate(sector)
        period = rng.choice([40, 50, 90])
        sign = rng.choice([1, -1])
        peak = rng.randrange(limit + 200, 100_000)
        duration = rng.choice([rng.uniform(1, 60), rng.uniform(60, 900)])  # until the limit
        stays = rng.random() < 0.5  # below zero it stays at zero, else the line goes on
        delay = rng.randrange(0, 40)  # from the instant of a sample to its arrival
        t = comm + rng.randrange(-period, period)
        before: tuple[int, int] | None = None
        wanted = None
        slope = (peak - limit) / duration
        cut = rng.random() < 0.15
        while wanted is None:
            if t < comm:
                # Taken before the commutation: of the sector before, or (sense delay) already of this one.
                await tb.sample(t, rng.choice([sector, (sector + 5) % 6]), rng.randrange(-90, 90), 5)
                t += period
                continue
            i = peak - slope * (t - comm)
            if stays or before is None:  # a current of the other sign at the first sample would be one that decays too
                i = max(i, 0.0)
            i = max(round(i), -100_000)
            await tb.clocks(max(0, t + delay - tb.now) if abs(t - tb.now) < 10_000 else 0)
            await tb.sample(t, sector, sign * i)
            if i <= limit:
                if before is None:
                    wanted = t - comm
                else:
                    tb_, ib = before
                    wanted = tb_ - comm + math.floor((t - tb_) * (ib - limit) / ((ib - limit) + (limit - i)) + 0.5)
            else:
                before = (t, i)
                if cut:
                    break
            t += period
        if wanted is None:
            opened += 1
            count = len(tb.results)
            await tb.commutate((sector + 1) % 6)
            await tb.clocks(2)
            assert tb.results[count:] == [(OPEN, sector, True)]
            await tb.sample(tb.now, (sector + 1) % 6, 0)  # ends the one that this began
            values.append((tb.results[-1][0], (sector + 1) % 6))
            continue
        assert tb.results[-1] == (wanted, sector, False), f"{k}: {tb.results[-1]}, {wanted}, sector {sector}"
        if before is not None and not stays and i > -100_000:
            assert abs(wanted - duration) <= 1.5 + 1 / slope
        values.append((wanted, sector))
        await tb.sample(t + period, sector, 0)
        if k % 10 == 9:
            snap = await tb.snapshot()
            assert snap["sum"] == sum(v for v, _ in values) and snap["count"] == len(values)
            assert snap["open"] == opened
            longest = OPEN if opened else max(v for v, _ in values)
            assert snap["max"] == longest
            if not opened:
                assert (longest, snap["max_sector"]) in values
            values, opened = [], 0
    snap = await tb.snapshot()
    assert snap == {"sum": 0, "max": 0, "max_sector": 0, "count": 0, "open": 0}


@cocotb.test()
async def latencies_and_long_gaps(dut: Any) -> None:
    """Latency as published; a gap beyond 16 bits takes the sample's own time; long times saturate.

    Verifies: FRW-01
    """
    tb = TB(dut)
    await tb.start(10)
    comm = await tb.commutate(0)
    await tb.sample(comm + 50, 0, 3, DIRECT_LATENCY - 2)
    assert tb.results == []
    await tb.clocks(1)
    assert tb.results == [(50, 0, False)]
    comm = await tb.commutate(1)
    await tb.sample(comm + 50, 1, -1010)
    await tb.sample(comm + 150, 1, 990, INTERPOLATED_LATENCY - 2)
    assert len(tb.results) == 1
    await tb.clocks(1)
    assert tb.results[-1] == (100, 1, False)
    comm = await tb.commutate(2)
    await tb.sample(comm + 50, 2, 1010)
    await tb.sample(comm + 50 + 65536, 2, 0)
    assert tb.results[-1] == (50 + 65536, 2, False)
    comm = await tb.commutate(3)
    await tb.sample(comm + (1 << 24) + 5, 3, 0)
    assert tb.results[-1] == (OPEN, 3, False)
    # -2^17 and the largest limit.
    await tb.start(131071)
    comm = await tb.commutate(4)
    await tb.sample(comm + 20, 4, -131072)
    await tb.sample(comm + 70, 4, 131071)
    assert tb.results[-1][:2] in [(20, 4), (21, 4)]


@cocotb.test()
async def disabled_measures_nothing(dut: Any) -> None:
    """Disabled: no result; enabling begins with the next commutation.

    Verifies: FRW-02
    """
    tb = TB(dut)
    await tb.start(10)
    dut.cfg_enable_i.value = 0
    dut.update_i.value = 1
    await tb.clocks(1)
    dut.update_i.value = 0
    comm = await tb.commutate(0)
    await tb.sample(comm + 50, 0, 0)
    dut.cfg_enable_i.value = 1
    dut.update_i.value = 1
    await tb.clocks(1)
    dut.update_i.value = 0
    await tb.sample(comm + 100, 0, 0)
    assert tb.results == []
    comm = await tb.commutate(1)
    await tb.sample(comm + 60, 1, 0)
    assert tb.results == [(60, 1, False)]


def test_fl_freewheel() -> None:
    """Freewheel block test."""
    run_block_test("fl_freewheel", ["zcd/fl_interpolator.sv", "zcd/fl_freewheel.sv"], __name__)
