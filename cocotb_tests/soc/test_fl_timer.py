# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Time base, control tick, update event and interval events through their registers."""

from __future__ import annotations

import itertools
import random
from typing import Any

import cocotb
from cocotb.triggers import FallingEdge

from cocotb_tests.soc.bench import Bench
from fluxlock.cosim.block import run_block_test

TICK_PERIOD, TICK_COUNT, TICK_TIME, UPDATE, MACHINE_PERIOD, LOAD_PERIOD, TICK_SAMPLES = range(0, 0x1C, 4)
# Clocks, published by the pages.
SYNC_TO_TICK = 1
TICK_TO_UPDATE = 0


class Events:
    """Records the clock number (now_o) of every pulse."""

    def __init__(self, dut: Any) -> None:
        self.dut = dut
        self.times: dict[str, list[int]] = {name: [] for name in ("tick_o", "update_o", "machine_o", "load_o")}
        cocotb.start_soon(self._run())

    async def _run(self) -> None:
        while True:
            await FallingEdge(self.dut.clk_i)
            for name, times in self.times.items():
                if getattr(self.dut, name).value == 1:
                    times.append(int(self.dut.now_o.value))


def gaps(times: list[int]) -> list[int]:
    return [b - a for a, b in itertools.pairwise(times)]


@cocotb.test
async def tick_period_is_exact(dut: Any) -> None:
    bench = Bench(dut)
    await bench.start(sync_i=0)
    events = Events(dut)
    await bench.clocks(50)
    assert not events.times["tick_o"], "a tick with period 0"
    written = int(dut.now_o.value)
    await bench.write(TICK_PERIOD, 37)
    await bench.clocks(37 * 6 + 10)
    ticks = events.times["tick_o"]
    # One clock for the register, then period + 1 from stop.
    assert ticks[0] == written + 1 + 38, f"first tick at {ticks[0]}, written at {written}"
    assert gaps(ticks) == [37] * (len(ticks) - 1) and len(ticks) >= 5, ticks
    count, stamp = await bench.read(TICK_COUNT), await bench.read(TICK_TIME)
    assert (count, stamp) == (len(ticks), ticks[-1])


@cocotb.test
async def tick_period_changes_at_tick(dut: Any) -> None:
    bench = Bench(dut)
    await bench.start(sync_i=0)
    events = Events(dut)
    await bench.write(TICK_PERIOD, 40)
    await bench.wait_high(dut.tick_o, 60)
    await bench.clocks(10)
    await bench.write(TICK_PERIOD, 100)
    await bench.clocks(250)
    assert gaps(events.times["tick_o"]) == [40, 100, 100], events.times["tick_o"]
    # A shorter period never waits for more than itself.
    await bench.write(TICK_PERIOD, 8)
    written = int(dut.now_o.value)
    await bench.clocks(20)
    later = [t for t in events.times["tick_o"] if t >= written]
    assert later[0] - written <= 9 and gaps(later) == [8] * (len(later) - 1), (written, later)
    await bench.write(TICK_PERIOD, 0)
    await bench.clocks(2)
    stopped = len(events.times["tick_o"])
    await bench.clocks(50)
    assert len(events.times["tick_o"]) == stopped, "ticks after stop"


@cocotb.test
async def tick_period_of_one(dut: Any) -> None:
    bench = Bench(dut)
    await bench.start(sync_i=0)
    events = Events(dut)
    await bench.write(TICK_PERIOD, 1)
    await bench.clocks(20)
    assert len(events.times["tick_o"]) >= 15 and set(gaps(events.times["tick_o"])) == {1}


@cocotb.test
async def update_only_at_tick_after_commit(dut: Any) -> None:
    period = 30
    bench = Bench(dut)
    await bench.start(sync_i=0)
    events = Events(dut)
    await bench.write(TICK_PERIOD, period)
    await bench.wait_high(dut.tick_o, 60)
    await bench.clocks(5 * period)
    assert not events.times["update_o"], "update without commit"
    expected = []
    # Every distance of the commit from the tick, the last clocks before it included.
    for offset in range(period):
        await bench.wait_high(dut.tick_o, period)
        await bench.clocks(offset)
        tick = events.times["tick_o"][-1] if offset else int(dut.now_o.value)
        committed = int(dut.now_o.value) + 1  # clock in which the commit pulse is high
        await bench.write(UPDATE, 1)
        await bench.clocks()
        if committed + 2 < tick + period:
            assert await bench.read(UPDATE) & 2, f"commit {offset} clocks after a tick is not pending"
        periods = 1 if committed < tick + period else 2
        expected.append(tick + periods * period + TICK_TO_UPDATE)
        await bench.clocks(2 * period)
    assert events.times["update_o"] == expected, f"{events.times['update_o']} != {expected}"
    assert set(events.times["update_o"]) <= set(events.times["tick_o"])
    assert not await bench.read(UPDATE) & 2


async def sync(bench: Bench) -> int:
    """A pulse of sync_i; the time of its clock."""
    now = int(bench.dut.now_o.value)
    bench.dut.sync_i.value = 1
    await bench.clocks()
    bench.dut.sync_i.value = 0
    return now


@cocotb.test
async def tick_follows_every_nth_sync(dut: Any) -> None:
    rng = random.Random(11)
    bench = Bench(dut)
    await bench.start(sync_i=0)
    events = Events(dut)
    for _ in range(5):
        await sync(bench)
    assert not events.times["tick_o"], "a tick by samples with tick_samples 0"
    # The period runs on beside it and must do nothing.
    await bench.write(TICK_PERIOD, 10)
    await bench.clocks(3)
    expected = []
    for n in (1, 2, 3, 7, 255):
        await bench.write(TICK_SAMPLES, n)
        events.times["tick_o"].clear()
        expected.clear()
        for k in range(3 * n):
            now = await sync(bench)
            if k % n == n - 1:
                expected.append(now + 1)
            await bench.clocks(rng.randrange(4) if k % n else 0)
        await bench.clocks(3)
        assert events.times["tick_o"] == expected, f"n = {n}: {events.times['tick_o']} != {expected}"
        assert await bench.read(TICK_TIME) == expected[-1], f"n = {n}"
    # Fewer than have come since the tick: the next one.
    await sync(bench)
    await sync(bench)
    await sync(bench)
    await bench.write(TICK_SAMPLES, 2)
    events.times["tick_o"].clear()
    now = await sync(bench)
    await bench.clocks(2)
    assert events.times["tick_o"] == [now + 1]
    # More than have come: those count.
    await sync(bench)
    await bench.write(TICK_SAMPLES, 3)
    await sync(bench)
    now = await sync(bench)
    await bench.clocks(2)
    assert events.times["tick_o"][1:] == [now + 1]
    # Back to the period: syncs do nothing and are forgotten.
    await sync(bench)
    await bench.write(TICK_SAMPLES, 0)
    written = int(dut.now_o.value)
    events.times["tick_o"].clear()
    for _ in range(35):
        await sync(bench)
    assert events.times["tick_o"][0] == written + 11 and gaps(events.times["tick_o"]) == [10, 10], events.times[
        "tick_o"
    ]
    await bench.write(TICK_SAMPLES, 2)
    events.times["tick_o"].clear()
    await sync(bench)
    await bench.clocks(20)
    assert not events.times["tick_o"], "a sync of the time before counted"


@cocotb.test
async def update_belongs_to_the_tick_by_samples(dut: Any) -> None:
    bench = Bench(dut)
    await bench.start(sync_i=0)
    events = Events(dut)
    await bench.write(TICK_SAMPLES, 2)
    # Commit high in the clock of the first sync, of the second, and of the clock after it.
    for clocks, late in ((0, 0), (3, 0), (4, 1)):
        events.times["update_o"].clear()
        syncs = []

        async def commit(clocks: int = clocks) -> None:
            await bench.clocks(clocks)
            await bench.write(UPDATE, 1)

        task = cocotb.start_soon(commit())
        await bench.clocks()
        for _ in range(4):
            syncs.append(await sync(bench))
            await bench.clocks(2)
        await task
        assert events.times["update_o"] == [syncs[1 + 2 * late] + SYNC_TO_TICK + TICK_TO_UPDATE], (
            clocks,
            syncs,
            events.times["update_o"],
        )


@cocotb.test
async def intervals(dut: Any) -> None:
    bench = Bench(dut)
    await bench.start(sync_i=0)
    events = Events(dut)
    await bench.write(MACHINE_PERIOD, 23)
    await bench.write(LOAD_PERIOD, 7)
    await bench.clocks(300)
    await bench.write(LOAD_PERIOD, 0)
    await bench.clocks(3)
    loads = len(events.times["load_o"])
    await bench.clocks(100)
    assert set(gaps(events.times["machine_o"])) == {23} and len(events.times["machine_o"]) >= 15
    assert set(gaps(events.times["load_o"])) == {7} and len(events.times["load_o"]) == loads
    assert not events.times["tick_o"] and not events.times["update_o"]


@cocotb.test
async def period_registers_hold_every_bit(dut: Any) -> None:
    bench = Bench(dut)
    await bench.start(sync_i=0)
    for adr, mask in ((TICK_PERIOD, 0xFFFFFF), (MACHINE_PERIOD, 0xFFFFFFFF), (LOAD_PERIOD, 0xFFFFFFFF)):
        for value in (0xFFFFFFFF, 0xA5C33C5A):
            await bench.write(adr, value)
            assert await bench.read(adr) == value & mask, hex(adr)


def test_fl_timer() -> None:
    """Tick, update event, time stamps and intervals to the clock.

    Verifies: SOC-01, SOC-02, SOC-03, SOC-20
    """
    run_block_test(
        "fl_timer_wb",
        ["soc/fl_bus_pkg.sv", "soc/fl_interval.sv", "soc/fl_timer.sv", "soc/fl_timer_wb.sv"],
        __name__,
        registers=["timer"],
    )
