"""Commutation timer: instants exact to the clock, timeouts, hand-over and counters.

Instants are worked out with exact fractions from the crossings that were played; gates are taken to change
GATE clocks after comm_valid_o, as fl_pkg::CommToGateCycles says.
"""

from __future__ import annotations

import random
from dataclasses import dataclass, field, replace
from fractions import Fraction
from itertools import pairwise
from math import floor
from pathlib import Path
from typing import Any

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, RisingEdge, Timer

from fluxlock.cosim.block import run_block_test

CLOCK_NS = 20
MASK32 = 0xFFFFFFFF
OFF, FORCED, ZCD, HALL = range(4)
GATE = 2  # clocks from comm_valid_o to the gate pins
CROSSING_LATENCY = 7  # least clocks from zc_valid_i to comm_valid_o, published by the module
SATURATED = (1 << 24) - 1


def diff(a: int, b: int) -> int:
    """Signed distance of two stamps, a after b."""
    d = (a - b) & MASK32
    return d - (1 << 32) if d >> 31 else d


@dataclass(frozen=True)
class Settings:
    """Settings of the timer as its ports take them."""

    mode: int = ZCD
    force_on_miss: int = 1
    miss_limit: int = 6
    delay_q16: int = 0x8000
    advance_q16: int = 0
    latency: int = 0
    forced_interval: int = 1000
    timeout_q12: int = 0x1800
    correction_a: int = 0
    hall_timed: int = 0
    hall_offset_q16: tuple[int, ...] = (0,) * 6
    reverse: int = 0

    @property
    def fraction(self) -> Fraction:
        """Delay from crossing to commutation, of an interval."""
        return max(Fraction(0), min(Fraction(1), Fraction(self.delay_q16 - self.advance_q16, 1 << 16)))

    def delay(self, interval: int) -> int:
        return floor(interval * self.fraction + Fraction(1, 2))

    def timeout(self, interval: int) -> int:
        return interval * self.timeout_q12 // 4096


@dataclass(frozen=True)
class Commutation:
    """gate: clock in which the gates change; sched: the wanted instant that came with it."""

    gate: int
    sched: int
    overdue: bool


@dataclass
class TB:
    """Plays crossings at chosen clocks, collects commutations and lost pulses."""

    dut: Any
    comms: list[Commutation] = field(default_factory=list)
    lost: list[int] = field(default_factory=list)

    async def start(self, settings: Settings, now: int = 0) -> None:
        dut = self.dut
        Clock(dut.clk_i, CLOCK_NS, unit="ns").start()
        for name in (
            "load_i",
            "load_now_i",
            "hold_sector_i",
            "update_i",
            "zc_valid_i",
            "zc_time_i",
            "zc_late_i",
            "zc_sector_i",
            "zc_back_i",
            "hall_valid_i",
            "hall_time_i",
            "hall_position_i",
            "hall_backward_i",
            "hall_single_i",
            "hall_ok_i",
            "tick_i",
        ):
            getattr(dut, name).value = 0
        self.stage(settings)
        dut.rst_i.value = 1
        await FallingEdge(dut.clk_i)
        await self.clocks(3)
        dut.rst_i.value = 0
        await self.jump(now)
        cocotb.start_soon(self.watch())
        await self.update(settings)

    async def clocks(self, n: int) -> None:
        if n > 0:
            await Timer(n * CLOCK_NS, "ns")

    async def jump(self, now: int) -> None:
        """The next clock's time is `now`."""
        self.dut.load_now_i.value = now & MASK32
        self.dut.load_i.value = 1
        await self.clocks(1)
        self.dut.load_i.value = 0

    async def watch(self) -> None:
        dut = self.dut
        while True:
            await RisingEdge(dut.event_o)
            await FallingEdge(dut.clk_i)
            if int(dut.comm_valid_o.value):
                self.comms.append(
                    Commutation(
                        (self.now() + GATE) & MASK32,
                        int(dut.comm_sched_o.value),
                        bool(int(dut.overdue_o.value)),
                    )
                )
            if int(dut.lost_o.value):
                self.lost.append(self.now())
            await self.clocks(1)

    def now(self) -> int:
        return int(self.dut.now_o.value)

    async def until(self, now: int) -> None:
        """Wait for the clock with this time (a stamp, at most half the range ahead)."""
        ahead = diff(now & MASK32, self.now())
        assert ahead >= 0, f"clock {now & MASK32} is {-ahead} clocks ago"
        await self.clocks(ahead)

    def stage(self, settings: Settings) -> None:
        dut = self.dut
        dut.cfg_mode_i.value = settings.mode
        dut.cfg_force_on_miss_i.value = settings.force_on_miss
        dut.cfg_miss_limit_i.value = settings.miss_limit
        dut.cfg_delay_q16_i.value = settings.delay_q16
        dut.cfg_advance_q16_i.value = settings.advance_q16 & 0xFFFF
        dut.cfg_latency_i.value = settings.latency
        dut.cfg_forced_interval_i.value = settings.forced_interval
        dut.cfg_timeout_q12_i.value = settings.timeout_q12
        dut.cfg_correction_a_i.value = settings.correction_a
        dut.cfg_hall_timed_i.value = settings.hall_timed
        dut.cfg_hall_offset_q16_i.value = sum((o & 0xFFFF) << (16 * i) for i, o in enumerate(settings.hall_offset_q16))
        dut.cfg_reverse_i.value = settings.reverse

    async def update(self, settings: Settings) -> int:
        """Take settings over; returns the time of the update's clock."""
        self.stage(settings)
        now = self.now()
        self.dut.update_i.value = 1
        await self.clocks(1)
        self.dut.update_i.value = 0
        return now

    async def crossing(self, time: int, sector: int | None = None, late: bool = False, back: bool = False) -> int:
        """Report a crossing in this clock, by default in the present sector; returns this clock's time."""
        dut = self.dut
        now = self.now()
        dut.zc_time_i.value = time & MASK32
        dut.zc_sector_i.value = int(dut.sector_o.value) if sector is None else sector
        dut.zc_late_i.value = int(late)
        dut.zc_back_i.value = int(back)
        dut.zc_valid_i.value = 1
        await self.clocks(1)
        dut.zc_valid_i.value = 0
        dut.zc_time_i.value = 0x7777_7777
        dut.zc_sector_i.value = 7
        return now

    async def snapshot(self) -> dict[str, int]:
        self.dut.tick_i.value = 1
        await self.clocks(1)
        self.dut.tick_i.value = 0
        names = (
            "interval",
            "period",
            "zc_time",
            "crossings",
            "misses",
            "late",
            "commutations",
            "overdue",
            "timeouts",
        )
        return {n: int(getattr(self.dut, f"snap_{n}_o").value) for n in names}

    def sector_intervals(self) -> list[int]:
        word = int(self.dut.snap_sector_interval_o.value)
        return [word >> (24 * i) & SATURATED for i in range(6)]


def check(comm: Commutation, wanted: int, reported: int | None, context: object) -> None:
    """The gates change exactly at the wanted instant, or at once if the crossing was reported too late."""
    assert comm.sched == wanted & MASK32, f"sched off by {diff(comm.sched, wanted & MASK32)}: {context}"
    first = None if reported is None else (reported + CROSSING_LATENCY + GATE) & MASK32
    overdue = first is not None and diff(first, wanted & MASK32) > 0
    gate = first if overdue and first is not None else wanted & MASK32
    assert comm.gate == gate, f"gates off by {diff(comm.gate, gate)} clocks (overdue {overdue}): {context}"
    assert comm.overdue == overdue, f"overdue flag: {context}"


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


async def spin_forced(tb: TB, interval: int, turns: int) -> int:
    """FORCED mode with a crossing in the middle of each visit; returns the last commutation's instant."""
    entry = await tb.update(Settings(mode=FORCED, forced_interval=interval))
    for k in range(turns):
        t = entry + interval * k + interval // 2
        await tb.until(t + 25)
        await tb.crossing(t)
        await tb.until(entry + interval * (k + 1) + 2)
    return entry + interval * turns


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


CORRECTION_LATENCY, HALL_LATENCY = 10, 10  # published by the module


def corrected_delay(settings: Settings, t0: int, t1: int, t2: int) -> float:
    """Thesis ch. 2: (-t[n] + t[n-1] + 3 t[n-2]) / 6 less the advance, with the general delay, limited."""
    delay = t0 * float(settings.fraction) + (-4 * t0 + t1 + 3 * t2) / 6
    return min(max(delay, 0.0), float(t0))


@cocotb.test()
@cocotb.parametrize(seed=list(range(4)))
async def correction_a(dut: Any, seed: int) -> None:
    """Random intervals, misses, late crossings, direction changes: the thesis' delay exactly where it may be used.

    Verifies: COMM-12
    """
    rng = random.Random(seed)
    tb = TB(dut)
    await tb.start(Settings(mode=OFF))
    reverse = 0
    settings = Settings(correction_a=1, timeout_q12=0x1C00, forced_interval=2000)
    await tb.update(settings)
    t = tb.now() + 300
    good: list[int] = []  # times of good crossings in a row
    last: int | None = None
    corrected = plain = 0
    for i in range(90):
        event = rng.random()
        if event < 0.04:
            reverse = 1 - reverse
            good = []
        if rng.random() < 0.2:
            settings = replace(settings, correction_a=rng.randrange(2), advance_q16=rng.choice([0, 0x2000, -0x1000]))
        settings = replace(settings, reverse=reverse)
        await tb.update(settings)
        late = rng.random() < 0.06
        back = late and rng.random() < 0.5
        await tb.until(t + 20)
        count = len(tb.comms)
        await tb.crossing(t, late=late, back=back)
        interval = settings.forced_interval if last is None else t - last
        good = [*good, t] if not late or back else []
        if late and not back:
            good = []
        use = settings.correction_a and len(good) >= 4
        if use:
            t0, t1, t2 = (good[-1 - k] - good[-2 - k] for k in range(3))
            wanted = t + corrected_delay(settings, t0, t1, t2)
        else:
            wanted = t + settings.delay(interval)
        await tb.until(max(round(wanted), tb.now()) + 12)
        assert len(tb.comms) == count + 1
        off = diff(tb.comms[-1].sched, round(wanted) & MASK32)
        assert abs(off) <= (1 if use else 0), f"seed {seed}, crossing {i}: off by {off}, corrected {use}"
        snap = await tb.snapshot()
        assert int(dut.snap_corrected_o.value) == int(bool(use)), f"crossing {i}: {good}"
        corrected += bool(use)
        plain += not use
        last = t
        if rng.random() < 0.04:  # a miss: the timeout commutates and assumes a crossing an interval after the last
            await tb.until(tb.comms[-1].gate + settings.timeout(interval) + 5)
            assert len(tb.comms) == count + 2
            assert snap["interval"] == (interval if i else SATURATED)
            known = i > 0
            last = t + interval if known else t
            good = []
            t = tb.now() + 300
            if not known:
                last = None
            continue
        t += max(1400 + rng.randrange(-250, 250), diff(tb.now(), t) + 30)
    assert corrected > 20 and plain > 10


@cocotb.test()
async def correction_a_is_neutral(dut: Any) -> None:
    """Equal intervals give half an interval to a clock, at any speed; a pattern of three gives even commutations.

    Verifies: COMM-12
    """
    tb = TB(dut)
    for scale in (200, 5000, 300_000):
        await tb.start(Settings(mode=OFF)) if scale == 200 else await tb.update(Settings(mode=OFF))
        await tb.update(Settings(correction_a=1, timeout_q12=0xFFFF, forced_interval=scale))
        # Position errors that sum to zero over three crossings (Yang 2020): 2, -3, 1 % of an interval.
        errors = [round(scale * e) for e in (0.02, -0.03, 0.01)]
        base = tb.now() + 50
        comms: list[int] = []
        for i in range(14):
            for pattern in [errors if i >= 6 else [0, 0, 0]]:
                t = base + scale * i + pattern[i % 3]
            await tb.until(t + 15)
            await tb.crossing(t)
            await tb.until(t + scale - scale // 8 - 15)
            comms.append(tb.comms[-1].sched)
            if 4 <= i < 6:
                assert abs(diff(comms[-1], (t + scale // 2) & MASK32)) <= 1 + scale * 4e-6
        steps = [diff(b, a) for a, b in pairwise(comms[10:])]
        assert all(abs(s - scale) <= 2 for s in steps), f"commutations {steps} apart, wanted {scale}"


@cocotb.test()
async def correction_a_latency(dut: Any) -> None:
    """With the correction an overdue commutation comes a constant number of clocks after its crossing.

    Verifies: COMM-12, COMM-03
    """
    tb = TB(dut)
    await tb.start(Settings(correction_a=1, timeout_q12=0xFFFF))
    t = tb.now() + 50
    for i in range(8):
        now = tb.now()
        late = i >= 4
        await tb.until(t + (900 if late else 20))
        now = await tb.crossing(t)
        await tb.until(max(t + 560, now + 30))
        if late:
            assert tb.comms[-1].overdue and tb.comms[-1].gate == now + CORRECTION_LATENCY + GATE
        t += 1000


async def edge(tb: TB, time: int, position: int, backward: int = 0, single: int = 1) -> int:
    """A Hall edge reported in this clock."""
    dut = tb.dut
    now = tb.now()
    dut.hall_time_i.value = time & MASK32
    dut.hall_position_i.value = position
    dut.hall_backward_i.value = backward
    dut.hall_single_i.value = single
    dut.hall_ok_i.value = 1
    dut.hall_valid_i.value = 1
    await tb.clocks(1)
    dut.hall_valid_i.value = 0
    return now


@cocotb.test()
@cocotb.parametrize(reverse=[0, 1])
async def hall_at_the_edge(dut: Any, reverse: int) -> None:
    """Untimed: each edge, either way, single or not, sets the sensors' sector a constant time after it; none else.

    Verifies: COMM-13
    """
    rng = random.Random(reverse)
    tb = TB(dut)
    await tb.start(Settings(mode=OFF, reverse=reverse))
    dut.hall_ok_i.value = 1
    dut.hall_position_i.value = 4
    await tb.update(Settings(mode=HALL, reverse=reverse))
    await tb.clocks(20)
    position = 4
    assert int(dut.sector_o.value) == (4 + 3 * reverse) % 6 and len(tb.comms) == 1, (
        "sector at the entry, standing still"
    )
    for k in range(40):
        step = rng.choice([1, -1, 1, -1, 2, 3])
        position = (position + step) % 6
        count = len(tb.comms)
        now = await edge(tb, tb.now() - 60, position, int(step == -1), int(abs(step) == 1))
        await tb.clocks(rng.choice([30, 200, 5000]))
        assert len(tb.comms) == count + 1, f"edge {k}"
        assert tb.comms[-1].gate == now + HALL_LATENCY + GATE and not tb.comms[-1].overdue
        assert int(dut.sector_o.value) == (position + 3 * reverse) % 6
    snap = await tb.snapshot()
    assert snap["timeouts"] == 0 and snap["misses"] == 0 and tb.lost == []


@cocotb.test()
@cocotb.parametrize(reverse=[0, 1], seed=list(range(4)))
async def hall_timed_corrects_misplacement(dut: Any, reverse: int, seed: int) -> None:
    """Misplaced sensors, both ways, with advance: commutations at the true angles to a clock, sectors in order.

    Verifies: COMM-13, COMM-14
    """
    rng = random.Random(seed)
    tb = TB(dut)
    scale = rng.choice([900, 5000, 20000])
    late = [rng.uniform(-0.24, 0.24) for _ in range(6)]  # of an interval, edge into a sector
    advance = rng.choice([0, 0x1000, 0x2000, -0x800])
    offsets = [0] * 6
    for sector in range(6):
        offsets[sector] = round(-late[sector] * 65536)
    latency = rng.choice([0, 40])
    settings = Settings(
        mode=HALL,
        hall_timed=1,
        hall_offset_q16=tuple(offsets),
        advance_q16=advance,
        latency=latency,
        reverse=reverse,
        timeout_q12=0x2000,
    )
    await tb.start(replace(settings, mode=OFF))
    step = -1 if reverse else 1
    start = tb.now() + 500
    position = rng.randrange(6)
    first = position
    dut.hall_position_i.value = position
    dut.hall_ok_i.value = 1
    await tb.update(settings)
    await tb.clocks(20)
    sector_of = {p: (p + 3 * reverse) % 6 for p in range(6)}
    assert int(dut.sector_o.value) == sector_of[first]
    edges = 30
    for k in range(1, edges):
        position = (first + step * k) % 6
        sector = sector_of[position]
        at = start + scale * k + round(late[sector] * scale)
        await tb.until(at + 25)
        await edge(tb, at, position, reverse)
    await tb.until(start + scale * edges)
    # From the seventh interval on the mean is that of a whole turn.
    true = {start + scale * k - round(scale * advance / 65536) - latency for k in range(10, edges + 2)}
    tail = [c for c in tb.comms if c.sched > start + scale * 9.6]
    assert len(tail) >= edges - 11
    for c in tail:
        error = min((c.sched - x for x in true), key=abs)
        assert abs(error) <= 2 + scale * 3e-5, f"off by {error} of {scale}: {settings}"
        assert c.gate == c.sched or c.overdue
    gaps = [b.gate - a.gate for a, b in pairwise(tail)]
    assert all(abs(g - scale) < scale * 0.1 + 60 for g in gaps), gaps
    # Late by no more than report and computation where the edge is ahead of the wanted instant.
    assert all(c.gate - c.sched <= 25 + HALL_LATENCY + GATE for c in tail)
    snap = await tb.snapshot()
    assert int(dut.snap_mean_o.value) in range(scale - 2, scale + 3)
    assert snap["timeouts"] == 0 and snap["misses"] == 0


@cocotb.test()
async def hall_standstill(dut: Any) -> None:
    """Timed and the edges stop: one sector ahead at most, then after the timeout back to the sensors' sector.

    Verifies: COMM-14
    """
    tb = TB(dut)
    settings = Settings(mode=HALL, hall_timed=1, timeout_q12=0x1800)
    await tb.start(replace(settings, mode=OFF))
    dut.hall_ok_i.value = 1
    await tb.update(settings)
    await tb.clocks(20)
    t = tb.now() + 500
    for k in range(1, 9):
        await tb.until(t + 1000 * k + 20)
        await edge(tb, t + 1000 * k, k % 6)
    last = t + 8000
    await tb.until(last + 1010)
    assert int(dut.sector_o.value) == 3, "timed ahead"
    await tb.until(last + 2510)
    assert int(dut.sector_o.value) == 2 and tb.comms[-1].gate == last + 2500
    count = len(tb.comms)
    await tb.until(last + 20_000)
    assert len(tb.comms) == count and tb.lost == []
    snap = await tb.snapshot()
    assert snap["timeouts"] == 1 and snap["misses"] == 0 and int(dut.snap_known_o.value) == 0
    now = await edge(tb, tb.now() - 9, 3)  # moves on: at the edge
    await tb.clocks(40)
    assert tb.comms[-1].gate == now + HALL_LATENCY + GATE and int(dut.sector_o.value) == 3
    # Turning back while the drive is set forward: at the edge, with the sensors.
    now = await edge(tb, tb.now() - 9, 2, backward=1)
    await tb.clocks(40)
    assert int(dut.sector_o.value) == 2


@cocotb.test()
@cocotb.parametrize(late_permille=[-150, 0, 150], when=[0.1, 0.45, 0.62, 0.97], timed=[0, 1])
async def zcd_to_hall_and_back(dut: Any, late_permille: int, when: float, timed: int) -> None:
    """At any point of a sector, sensors early or late: every sector follows the one before, none is skipped.

    Verifies: COMM-15
    """
    tb = TB(dut)
    scale = 2000
    await tb.start(Settings(mode=OFF))
    zcd = Settings(mode=ZCD, timeout_q12=0x1C00)
    late = late_permille * scale // 1000
    offsets = (round(-late_permille * 65.536),) * 6
    hall = Settings(mode=HALL, hall_timed=timed, hall_offset_q16=offsets, timeout_q12=0x1C00)
    await tb.update(zcd)
    start = tb.now() + 200
    sectors: list[tuple[int, int]] = []

    async def watch() -> None:
        last = int(dut.sector_o.value)
        while True:
            await FallingEdge(dut.clk_i)
            if int(dut.sector_o.value) != last:
                last = int(dut.sector_o.value)
                sectors.append((tb.now(), last))

    cocotb.start_soon(watch())
    # Commutation into k % 6 is due at start + scale * k; crossing half an interval before; edges `late`.
    events: list[tuple[int, str, int]] = []
    for k in range(1, 25):
        events.append((start + scale * k - scale // 2 + 30, "zc", k))
        events.append((start + scale * k + late + 40, "edge", k))
    events.append((start + scale * 10 + int(when * scale), "hall", 0))
    events.append((start + scale * 17 + int(when * scale), "zcd", 0))
    dut.hall_ok_i.value = 1
    dut.hall_single_i.value = 1
    for at, kind, k in sorted(events):
        await tb.until(at)
        if kind == "zc":
            await tb.crossing(start + scale * k - scale // 2)
        elif kind == "edge":
            await edge(tb, start + scale * k + late, k % 6)
        else:
            await tb.update(hall if kind == "hall" else zcd)
    await tb.clocks(scale)
    order = [s for _, s in sectors]
    assert all(b == (a + 1) % 6 for a, b in pairwise(order)), order
    assert len(order) >= 23
    for at, sector in sectors[3:]:
        k = round((at - start) / scale)
        assert k % 6 == sector, f"sector {sector} at {(at - start) / scale:.2f} sectors"
        hall_steps = start + scale * 10 < at < start + scale * 19.5
        allowed = abs(late) + 60 if hall_steps and not timed else 130
        assert abs(at - start - scale * k) <= allowed, f"sector {sector} off by {at - start - scale * k} clocks"


@cocotb.test()
async def hall_stops_crossings_that_have_run_ahead(dut: Any) -> None:
    """ZCD one sector ahead of the sensors with its next commutation pending: HALL waits for the edge instead.

    Verifies: COMM-15
    """
    tb = TB(dut)
    scale = 2000
    await tb.start(Settings(mode=OFF))
    hall = Settings(mode=HALL, hall_timed=1, timeout_q12=0x1C00)
    await tb.update(hall)
    dut.hall_ok_i.value = 1
    dut.hall_single_i.value = 1
    start = tb.now() + 200
    for k in range(1, 9):
        await tb.until(start + scale * k + 40)
        await edge(tb, start + scale * k, k % 6)
    await tb.until(start + scale * 8 + 100)
    await tb.update(Settings(mode=ZCD, timeout_q12=0x1C00))
    # Crossings much too early: into 3 a quarter of a sector after 2, into 4 soon after.
    assert int(dut.sector_o.value) == 2
    await tb.crossing(start + scale * 8 - scale // 3)
    await tb.until(start + scale * 8 + 900)
    assert int(dut.sector_o.value) == 3
    await tb.crossing(start + scale * 8 + 700)
    await tb.update(hall)
    count = len(tb.comms)
    await tb.until(start + scale * 9)
    assert int(dut.sector_o.value) == 3 and len(tb.comms) == count, "a commutation of before came through"
    await tb.until(start + scale * 9 + 40)
    await edge(tb, start + scale * 9, 3)
    # The mean still holds an interval of the wrong crossings.
    await tb.until(start + scale * 10 - 200)
    assert int(dut.sector_o.value) == 3
    await tb.until(start + scale * 10 + 40)
    assert int(dut.sector_o.value) == 4


def test_fl_commutation_timer() -> None:
    """Commutation timer block test."""
    run_block_test(
        "timer_bench",
        [
            "zcd/fl_interval_meter.sv",
            "zcd/fl_commutation_timer.sv",
            Path(__file__).with_name("timer_bench.sv"),
        ],
        __name__,
    )
