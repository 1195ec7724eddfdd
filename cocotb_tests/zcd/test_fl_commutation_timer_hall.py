# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Commutation timer: Hall edges, and hand-over between them and the crossings."""

from __future__ import annotations

import random
from dataclasses import replace
from itertools import pairwise
from typing import Any

import cocotb
from cocotb.triggers import FallingEdge

from cocotb_tests.zcd.timer_bench import (
    GATE,
    HALL,
    HALL_LATENCY,
    OFF,
    TB,
    TIMER_SOURCES,
    ZCD,
    Settings,
    edge,
)
from fluxlock.cosim.block import run_block_test


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


def test_fl_commutation_timer_hall() -> None:
    """Commutation timer: Hall edges."""
    run_block_test("timer_bench", TIMER_SOURCES, __name__)
