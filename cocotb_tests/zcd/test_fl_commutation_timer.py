# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Commutation timer: instants exact to the clock, forced commutations, hand-over, settings."""

from __future__ import annotations

import random
from dataclasses import replace
from fractions import Fraction
from math import floor
from typing import Any

import cocotb

from cocotb_tests.zcd.timer_bench import (
    CROSSING_LATENCY,
    FORCED,
    GATE,
    HALL,
    MASK32,
    OFF,
    SATURATED,
    TB,
    TIMER_SOURCES,
    ZCD,
    Commutation,
    Settings,
    check,
    diff,
    spin_forced,
)
from fluxlock.cosim.block import run_block_test


@cocotb.test()
@cocotb.parametrize(seed=list(range(10)))
async def instant_is_exact(dut: Any, seed: int) -> None:
    """Random intervals, delays, advances, latencies, report delays, over the wrap: exact to the clock.

    Verifies: COMM-01, COMM-02, COMM-03, COMM-09
    """
    rng = random.Random(seed)
    settings = Settings(timeout_q12=0xFFFF)
    tb = TB(dut)
    scale = rng.choice([150, 800, 3000, 12000])
    await tb.start(settings, now=rng.choice([0, (1 << 32) - 20 * scale]))
    previous = None
    t = tb.now() + 100  # not wrapped
    for i in range(60):
        if i % 5 == 4:
            settings = replace(
                settings,
                delay_q16=rng.choice([0x8000, 0, 0xFFFF, rng.randrange(1 << 16)]),
                advance_q16=rng.choice([0, 0, -32768, 32767, rng.randrange(-(1 << 14), 1 << 14)]),
                latency=rng.choice([0, 1, 100, rng.randrange(scale // 4)]),
            )
            await tb.update(settings)
        interval = settings.forced_interval if previous is None else t - previous
        wanted = t + settings.delay(interval) - settings.latency
        await tb.until(t + max(0, diff(tb.now(), t & MASK32)) + rng.choice([13, 30, 60]))
        count = len(tb.comms)
        reported = await tb.crossing(t, late=rng.random() < 0.2)
        await tb.clocks(6)
        context = f"seed {seed}, crossing {i} at {t}, interval {interval}, {settings}"
        if diff(wanted & MASK32, tb.now()) > 10:
            assert int(dut.sched_valid_o.value) == 1, f"not announced: {context}"
            assert int(dut.comm_sched_o.value) == wanted & MASK32
            await tb.until(wanted)
        else:
            await tb.clocks(12)
        assert len(tb.comms) == count + 1, f"{len(tb.comms) - count} commutations: {context}"
        check(tb.comms[-1], wanted, reported, context)
        assert int(dut.sched_valid_o.value) == 0
        previous = t
        t = max(t + scale + rng.randrange(-scale // 10, scale // 10), t + diff(tb.now(), t & MASK32) + 5)
    snap = await tb.snapshot()
    assert snap["crossings"] == 60 and snap["commutations"] == 60 and snap["timeouts"] == 0
    assert snap["overdue"] == sum(c.overdue for c in tb.comms)


@cocotb.test()
async def advance_is_limited(dut: Any) -> None:
    """Delay less advance stays within 0..1 interval, and works beyond 30 degrees on both sides.

    Verifies: COMM-02
    """
    tb = TB(dut)
    settings = Settings(timeout_q12=0xFFFF)
    await tb.start(settings)
    t, interval = 2000, 1500
    cases = [
        (0, 0),
        (0, 1),
        (0xFFFF, -32768),
        (0x8000, 32767),
        (0x8000, -32768),
        (1, 32767),
        (0xC000, -16385),
    ]
    for i, (delay, advance) in enumerate([(0x8000, 0), (0x8000, 0), *cases]):
        settings = replace(settings, delay_q16=delay, advance_q16=advance)
        await tb.update(settings)
        await tb.until(t + 20)
        reported = await tb.crossing(t)
        await tb.clocks(2 * interval - 20 - 60)
        if i >= 2:
            assert 0 <= settings.delay(interval) <= interval
            check(tb.comms[-1], t + settings.delay(interval), reported, f"delay {delay}, advance {advance}")
        assert len(tb.comms) == i + 1
        # One commutation a crossing: the interval is measured over the clocks that really passed.
        interval = 1500
        t += interval
        if tb.now() > t + 20:
            jump_by = tb.now() - t
            t += jump_by
            interval += jump_by
    snap = await tb.snapshot()
    assert snap["crossings"] == len(cases) + 2


@cocotb.test()
async def forced_is_periodic(dut: Any) -> None:
    """FORCED: multiples of the interval from the entry on; a new one counts from the next schedule.

    Verifies: COMM-04
    """
    rng = random.Random(3)
    tb = TB(dut)
    settings = Settings(mode=FORCED, forced_interval=500)
    await tb.start(replace(settings, mode=OFF), now=(1 << 32) - 9000)
    entry = await tb.update(settings)
    expected = [entry + 500]
    for _ in range(60):
        await tb.until(expected[-1] - rng.randrange(5, 60))
        if rng.random() < 0.5:
            settings = replace(settings, forced_interval=rng.choice([0, 63, 64, 65, rng.randrange(64, 900)]))
            await tb.update(settings)
        await tb.until(expected[-1] + 1)
        expected.append(expected[-1] + max(64, settings.forced_interval))
        assert int(dut.sched_valid_o.value) == 1 and int(dut.comm_sched_o.value) == expected[-1] & MASK32
    assert [c.gate for c in tb.comms] == [e & MASK32 for e in expected[: len(tb.comms)]]
    assert all(c.gate == c.sched and not c.overdue for c in tb.comms) and len(tb.comms) >= 60


@cocotb.test()
async def forced_does_not_use_crossings(dut: Any) -> None:
    """Crossings in FORCED mode move no commutation but update intervals, period and counters.

    Verifies: COMM-04, COMM-07, COMM-08
    """
    rng = random.Random(5)
    tb = TB(dut)
    await tb.start(Settings(mode=OFF))
    entry = await tb.update(Settings(mode=FORCED, forced_interval=700))
    last: int | None = None
    sectors, intervals = [SATURATED] * 6, list[int]()
    for k in range(20):
        t = entry + 700 * k + 300 + rng.randrange(100)
        sector = int(dut.sector_o.value)
        await tb.until(t + 25)
        await tb.crossing(t, late=k % 4 == 0)
        if last is not None:
            intervals.append(t - last)
            sectors[sector] = t - last
        last = t
        await tb.clocks(5)
        snap = await tb.snapshot()
        assert snap["interval"] == (intervals[-1] if intervals else SATURATED)
        assert snap["zc_time"] == t
        assert snap["crossings"] == k + 1 and snap["late"] == k // 4 + 1
        assert tb.sector_intervals() == sectors
        assert snap["period"] == sum(sectors)
        if len(intervals) >= 6:
            assert snap["period"] == sum(intervals[-6:])
        await tb.until(entry + 700 * (k + 1) + 2)
    assert [c.gate for c in tb.comms] == [entry + 700 * (k + 1) for k in range(20)]


@cocotb.test()
@cocotb.parametrize(crossing_at=[None, 400, 490])
async def handover(dut: Any, crossing_at: int | None) -> None:
    """FORCED to ZCD: the running schedule stays unless a crossing of this visit replaces it.

    Verifies: COMM-05
    """
    tb = TB(dut)
    await tb.start(Settings(mode=OFF))
    last = await spin_forced(tb, 1000, 6)
    await tb.until(last + 200)
    await tb.update(Settings(mode=ZCD, forced_interval=5000))
    await tb.clocks(2)
    assert int(dut.sched_valid_o.value) == 1 and int(dut.comm_sched_o.value) == last + 1000
    if crossing_at is None:
        await tb.until(last + 1010)
        assert tb.comms[-1] == Commutation(last + 1000, last + 1000, False)
        t = last + 1000 + 530  # the crossing in the next visit goes on from there, 2030 after the last one
        await tb.until(t + 30)
        await tb.crossing(t)
        await tb.until(t + 600)
        # Two commutations since the last crossing: its distance is no interval, the last measured one holds.
        assert tb.comms[-1] == Commutation(t + 500, t + 500, False)
    else:
        t = last + crossing_at
        interval = t - (last - 500)
        await tb.until(t + 25)
        await tb.crossing(t)
        wanted = t + floor(Fraction(interval, 2) + Fraction(1, 2))
        await tb.until(wanted + 10)
        assert tb.comms[-1] == Commutation(wanted, wanted, False)
        assert len(tb.comms) == 7


@cocotb.test()
async def handover_crossing_at_the_last_clock(dut: Any) -> None:
    """A crossing reported up to the deciding clock of the forced commutation wins, a later one does not.

    Verifies: COMM-05
    """
    tb = TB(dut)
    await tb.start(Settings(mode=OFF))
    for clocks_before, replaced in ((4, True), (3, True), (2, False)):
        await tb.update(Settings(mode=OFF))
        await tb.clocks(10)
        last = await spin_forced(tb, 1000, 3)
        sector = int(dut.sector_o.value)
        await tb.update(Settings(mode=ZCD))
        count = len(tb.comms)
        await tb.until(last + 1000 - clocks_before)
        await tb.crossing(last + 500, sector)
        await tb.clocks(30)
        assert len(tb.comms) == count + 1
        # 1000 clocks since the last crossing: wanted at last + 1000 too, but known too late for that.
        gate = last + 1000 - clocks_before + CROSSING_LATENCY + GATE if replaced else last + 1000
        assert tb.comms[-1] == Commutation(gate, last + 1000, replaced), f"{clocks_before} clocks before"


@cocotb.test()
@cocotb.parametrize(missing=[1, 2, 3, 5])
async def handover_with_an_old_interval(dut: Any, missing: int) -> None:
    """Commutations without crossing before the hand-over: from three on the forced interval stands in again.

    Verifies: COMM-02, COMM-07
    """
    tb = TB(dut)
    await tb.start(Settings(mode=OFF))
    last = await spin_forced(tb, 1000, 4)
    await tb.update(Settings(mode=FORCED, forced_interval=700))
    await tb.until(last + 1000 + 700 * (missing - 1) + 5)
    assert len(tb.comms) == 4 + missing
    await tb.update(Settings(mode=ZCD, forced_interval=700))
    t = tb.now() + 100
    await tb.until(t + 30)
    await tb.crossing(t)
    await tb.until(t + 600)
    # spin_forced's last visit had a crossing, so one more commutation than `missing` lies between.
    delay = 350 if missing + 1 >= 3 else 500
    assert tb.comms[-1] == Commutation(t + delay, t + delay, False)


@cocotb.test()
async def off_and_shadowing(dut: Any) -> None:
    """Staged settings wait for the update; OFF cancels the schedule at once; leaving OFF clears counters.

    Verifies: COMM-11
    """
    tb = TB(dut)
    await tb.start(Settings(mode=OFF))
    await tb.crossing(5)
    await tb.clocks(200)
    assert (await tb.snapshot())["crossings"] == 0
    entry = await tb.update(Settings(mode=FORCED, forced_interval=300))
    tb.stage(Settings(mode=OFF, forced_interval=64, miss_limit=1))
    await tb.until(entry + 310)
    assert [c.gate for c in tb.comms] == [entry + 300]
    # OFF in the very clock that would decide.
    await tb.until(entry + 600 - GATE - 1)
    await tb.update(Settings(mode=OFF))
    await tb.clocks(1000)
    assert len(tb.comms) == 1 and int(dut.sched_valid_o.value) == 0
    assert (await tb.snapshot())["commutations"] == 1
    await tb.update(Settings(mode=HALL))
    await tb.clocks(5000)
    assert len(tb.comms) == 1, "no valid Hall code: no commutation"
    await tb.update(Settings(mode=OFF))
    entry = await tb.update(Settings(mode=FORCED, forced_interval=300))
    snap = await tb.snapshot()
    assert snap["commutations"] == 0 and snap["interval"] == SATURATED and snap["period"] == 6 * SATURATED
    await tb.until(entry + 305)
    assert tb.comms[-1].gate == entry + 300


@cocotb.test()
async def back_to_forced(dut: Any) -> None:
    """ZCD to FORCED: what was scheduled is dropped, the first commutation comes an interval after the entry.

    Verifies: COMM-04
    """
    tb = TB(dut)
    await tb.start(Settings())
    for delay in (2, 4, 5, 6, 7, 100):
        t = tb.now()
        await tb.crossing(t)
        await tb.clocks(delay - 1)
        count = len(tb.comms)
        entry = await tb.update(Settings(mode=FORCED, forced_interval=400))
        await tb.until(entry + 405)
        assert [c.gate for c in tb.comms[count:]] == [entry + 400], f"{delay} clocks after the crossing"
        await tb.update(Settings())
        await tb.clocks(500)


def test_fl_commutation_timer() -> None:
    """Commutation timer: instants, modes and settings."""
    run_block_test("timer_bench", TIMER_SOURCES, __name__)
