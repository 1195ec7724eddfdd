# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Commutation timer: timeouts, missed crossings, and intervals across them."""

from __future__ import annotations

from fractions import Fraction
from math import floor
from typing import Any

import cocotb

from cocotb_tests.zcd.timer_bench import (
    FORCED,
    GATE,
    MASK32,
    OFF,
    SATURATED,
    TB,
    TIMER_SOURCES,
    Commutation,
    Settings,
)
from fluxlock.cosim.block import run_block_test


@cocotb.test()
async def first_crossing_uses_the_forced_interval(dut: Any) -> None:
    """ZCD straight from OFF: until one is measured the forced interval stands in, for delay and timeout.

    Verifies: COMM-02, COMM-06
    """
    tb = TB(dut)
    await tb.start(Settings(mode=OFF))
    settings = Settings(forced_interval=3000, timeout_q12=0x2000)
    entry = await tb.update(settings)
    t = entry + 900
    await tb.until(t + 30)
    await tb.crossing(t)
    await tb.until(t + 1510)
    assert tb.comms == [Commutation(t + 1500, t + 1500, False)]
    await tb.until(t + 1500 + 6000 + 10)  # no crossing: two forced intervals after the commutation
    assert tb.comms[1:] == [Commutation(t + 7500, t + 7500, False)]


@cocotb.test()
async def timeout_from_entry(dut: Any) -> None:
    """Without any crossing the first timeout runs from the entry into ZCD mode.

    Verifies: COMM-06
    """
    tb = TB(dut)
    await tb.start(Settings(mode=OFF))
    entry = await tb.update(Settings(forced_interval=1000, timeout_q12=0x1800, miss_limit=3))
    await tb.until(entry + 4 * 1500 + 20)
    assert [c.gate for c in tb.comms] == [entry + 1500 * (k + 1) for k in range(4)]
    assert tb.lost == [entry + 4500 - GATE]


@cocotb.test()
@cocotb.parametrize(timeout=[0x0C00, 0x1800, 0xF000])
async def missed_crossings(dut: Any, timeout: int) -> None:
    """A miss commutates at the timeout, the assumed crossing keeps the interval, a real one ends the row.

    Verifies: COMM-06
    """
    tb = TB(dut)
    settings = Settings(timeout_q12=timeout, miss_limit=3)
    await tb.start(settings)
    t = tb.now() + 50
    for _ in range(4):
        await tb.until(t + 20)
        await tb.crossing(t)
        t += 1200
        await tb.until(t - 400)
    t -= 1200
    comm = t + 600
    assert tb.comms[-1].gate == comm
    for k in range(2):
        comm += settings.timeout(1200)
        await tb.until(comm - 4)
        assert int(dut.sched_valid_o.value) == 0, "a timeout is no schedule"
        await tb.until(comm + 3)
        assert tb.comms[-1] == Commutation(comm, comm, False)
        snap = await tb.snapshot()
        assert snap["misses"] == k + 1 and snap["timeouts"] == k + 1
        assert snap["interval"] == 1200
        assert snap["zc_time"] == t + 1200 * (k + 1), "the assumed crossing is an interval after the last"
    real = comm + 300
    await tb.until(real + 25)
    await tb.crossing(real)
    interval = real - (t + 2400)
    wanted = real + floor(Fraction(interval, 2) + Fraction(1, 2))
    await tb.until(wanted + 5)
    assert tb.comms[-1] == Commutation(wanted, wanted, False)
    snap = await tb.snapshot()
    assert snap["misses"] == 0 and snap["timeouts"] == 2 and snap["interval"] == interval and snap["crossings"] == 5
    assert tb.lost == []


@cocotb.test()
@cocotb.parametrize(limit=[0, 1, 4])
async def lost_lock(dut: Any, limit: int) -> None:
    """lost_o pulses once, when the consecutive misses reach the limit; a limit of 0 never does.

    Verifies: COMM-06
    """
    tb = TB(dut)
    entry_settings = Settings(forced_interval=100, timeout_q12=0x1000, miss_limit=limit)
    await tb.start(Settings(mode=OFF))
    entry = await tb.update(entry_settings)
    await tb.until(entry + 100 * 300 + 10)  # beyond the 8-bit counter
    assert len(tb.comms) == 300
    assert tb.lost == ([entry + 100 * limit - GATE] if limit else [])
    snap = await tb.snapshot()
    assert snap["misses"] == 255 and snap["timeouts"] == 300 & 0xFF


@cocotb.test()
async def misses_are_only_reported(dut: Any) -> None:
    """Without force_on_miss a timeout commutates nothing, counts, runs again, and leads to lost_o.

    Verifies: COMM-06
    """
    tb = TB(dut)
    await tb.start(Settings(mode=OFF))
    entry = await tb.update(Settings(forced_interval=1000, timeout_q12=0x1000, miss_limit=3, force_on_miss=0))
    await tb.until(entry + 5 * 1000 + 10)
    assert tb.comms == []
    assert tb.lost == [entry + 3000 - GATE]
    snap = await tb.snapshot()
    assert snap["misses"] == 5 and snap["timeouts"] == 5 and snap["commutations"] == 0
    t = tb.now() - 20
    await tb.crossing(t)
    await tb.until(t + 505)
    assert [c.gate for c in tb.comms] == [t + 500]
    assert (await tb.snapshot())["misses"] == 0


@cocotb.test()
@cocotb.parametrize(held=[False, True])
async def crossing_of_the_sector_before(dut: Any, held: bool) -> None:
    """A crossing whose sector a timeout has just left is measured but does not commutate again.

    With `held` the gates follow later (RSC) and the crossing even lies after the timeout.

    Verifies: COMM-10
    """
    tb = TB(dut)
    await tb.start(Settings(timeout_q12=0x1800))
    t = tb.now() + 50
    for _ in range(4):
        await tb.until(t + 20)
        await tb.crossing(t)
        t += 1200
        await tb.until(t - 400)
    t -= 1200
    comm = t + 600 + 1800
    sector = int(dut.sector_o.value)
    dut.hold_sector_i.value = int(held)
    await tb.until(comm + (150 if held else 20))
    assert tb.comms[-1].gate == comm
    count = len(tb.comms)
    real = comm + 100 if held else comm - 15
    await tb.crossing(real, sector)
    await tb.clocks(20)
    snap = await tb.snapshot()
    assert snap["zc_time"] == real and snap["misses"] == 0 and snap["crossings"] == 5
    assert snap["interval"] == 1200
    assert len(tb.comms) == count and int(dut.sched_valid_o.value) == 0
    dut.hold_sector_i.value = 0
    await tb.clocks(5)
    # The next visit's crossing is used as ever; its interval runs from the real one.
    following = real + 1100
    await tb.until(following + 30)
    await tb.crossing(following)
    await tb.until(following + 560)
    assert tb.comms[count:] == [Commutation(following + 550, following + 550, False)]


@cocotb.test()
async def forced_crossing_in_the_pipeline(dut: Any) -> None:
    """FORCED: a crossing that arrives after the commutation which ended its visit is measured as its visit's.

    Verifies: COMM-10, COMM-07
    """
    tb = TB(dut)
    await tb.start(Settings(mode=OFF))
    entry = await tb.update(Settings(mode=FORCED, forced_interval=800))
    t = None
    for k in range(12):
        sector = int(dut.sector_o.value)
        comm = entry + 800 * (k + 1)
        previous, t = t, comm - 10 - k
        await tb.until(comm + 20)
        await tb.crossing(t, sector)
        await tb.clocks(5)
        if previous is not None:
            snap = await tb.snapshot()
            assert snap["interval"] == t - previous
            assert tb.sector_intervals()[sector] == t - previous


@cocotb.test()
async def missing_crossings_do_not_stretch_the_interval(dut: Any) -> None:
    """A distance over several visits is no interval; after three commutations without crossing it is unknown.

    Verifies: COMM-07
    """
    tb = TB(dut)
    await tb.start(Settings(mode=OFF))
    entry = await tb.update(Settings(mode=FORCED, forced_interval=1000))
    expected = SATURATED
    last_k = None
    for k in range(24):
        await tb.until(entry + 1000 * k + 500 + k)
        if k % 7 not in (3, 4, 5):
            await tb.crossing(tb.now() - 5)
            if last_k == k - 1:
                expected = 1001
            last_k = k
            await tb.clocks(5)
            assert (await tb.snapshot())["interval"] == expected, f"visit {k}"
        await tb.until(entry + 1000 * (k + 1) + 2)


@cocotb.test()
@cocotb.parametrize(
    jumps=[
        [5000],
        [SATURATED - 1],
        [SATURATED],
        [SATURATED + 1],
        [1 << 28],
        [(1 << 31) - 100],
        [1 << 30, 1 << 30, 1 << 30],
        [1 << 30, 1 << 30, 1 << 30, (1 << 30) - 5000],  # almost a whole turn of the stamps
        [1 << 30, 1 << 30, 1 << 30, (1 << 30) + 5000],
    ]
)
async def saturation_and_long_pauses(dut: Any, jumps: list[int]) -> None:
    """Intervals saturate at 24 bits, also when the stamps wrap in the pause; the next one is right.

    Verifies: COMM-07
    """
    tb = TB(dut)
    await tb.start(Settings(mode=OFF), now=(1 << 32) - 50)
    await tb.update(Settings(forced_interval=64, force_on_miss=0, miss_limit=0))
    for _ in range(2):  # the interval before the pause is short and known
        now = tb.now()
        await tb.crossing(now)
        await tb.clocks(60)
    assert (await tb.snapshot())["interval"] == 61
    assert len(tb.comms) == 2
    for jump in jumps[:-1]:
        now += jump
        await tb.jump(now)
        await tb.clocks(3)
    now += jumps[-1]
    await tb.jump(now - 20)
    await tb.until(now + 20)
    assert len(tb.comms) == 2
    await tb.crossing(now)
    await tb.clocks(6)
    snap = await tb.snapshot()
    assert snap["interval"] == min(sum(jumps), SATURATED)
    assert snap["zc_time"] == now & MASK32
    # A commutation and a crossing later the interval is an ordinary one again.
    await tb.update(Settings(mode=FORCED, forced_interval=64))
    await tb.clocks(70)
    assert len(tb.comms) == 3
    await tb.crossing(now + 90)
    await tb.clocks(6)
    assert (await tb.snapshot())["interval"] == 90


@cocotb.test()
async def slow_timeout_is_exact(dut: Any) -> None:
    """A timeout of 15.99 saturated intervals lies 2^28 clocks ahead and is met to the clock.

    Verifies: COMM-06
    """
    tb = TB(dut)
    await tb.start(Settings(mode=OFF))
    settings = Settings(forced_interval=SATURATED, timeout_q12=0xFFFF)
    entry = await tb.update(settings)
    deadline = entry + settings.timeout(SATURATED)
    await tb.clocks(10)
    await tb.jump(deadline - 50)
    await tb.until(deadline - 4)
    assert tb.comms == []
    await tb.until(deadline + 5)
    assert tb.comms == [Commutation(deadline & MASK32, deadline & MASK32, False)]


def test_fl_commutation_timer_misses() -> None:
    """Commutation timer: timeouts and missed crossings."""
    run_block_test("timer_bench", TIMER_SOURCES, __name__)
