# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Drives the commutation timer with its interval meter, settings as its ports take them.

Instants are worked out with exact fractions from the crossings that were played; gates are taken to change
GATE clocks after comm_valid_o, as fl_pkg::CommToGateCycles says.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from math import floor
from pathlib import Path
from typing import Any

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, RisingEdge, Timer

TIMER_SOURCES: Sequence[str | Path] = (
    "zcd/fl_interval_meter.sv",
    "zcd/fl_commutation_timer.sv",
    Path(__file__).with_name("timer_bench.sv"),
)
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


async def spin_forced(tb: TB, interval: int, turns: int) -> int:
    """FORCED mode with a crossing in the middle of each visit; returns the last commutation's instant."""
    entry = await tb.update(Settings(mode=FORCED, forced_interval=interval))
    for k in range(turns):
        t = entry + interval * k + interval // 2
        await tb.until(t + 25)
        await tb.crossing(t)
        await tb.until(entry + interval * (k + 1) + 2)
    return entry + interval * turns


CORRECTION_LATENCY, HALL_LATENCY = 10, 10  # published by the module


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
