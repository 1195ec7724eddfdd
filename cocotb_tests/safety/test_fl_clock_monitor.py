# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Clock monitor: against a model of the intervals, and with clocks at, beyond and far beyond its limits."""

from __future__ import annotations

import math
import os
import random
from itertools import pairwise
from typing import Any

import cocotb
import pytest
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, RisingEdge, Timer

from cocotb_tests.board.clocks import BOARDS, limits
from fluxlock.cosim.block import run_block_test

PERIOD_NS = 1000  # of the clock that watches: beats are placed to a thousandth of it
SYNC_EDGES = 2  # from the edge that sees a level to the one that acts on it
TOGGLE_TO_BAD = 3  # clock edges more than MostCycles from the last toggle to bad_o, at most; published by the header


class Model:
    """What the block says after each edge, from the levels that the edges have seen: intervals, no counters."""

    def __init__(self, least: int, most: int) -> None:
        self.least, self.most = least, most
        self.seen: list[tuple[int, int]] = []  # beat and hold at each edge
        self.bad = 0

    def edge(self, beat: int, hold: int) -> int:
        """bad_o after an edge that sees these levels."""
        self.seen.append((beat, hold))
        now = len(self.seen) - 1 - SYNC_EDGES  # what was seen then acts now
        holds = [n for n in range(now + 1) if self.seen[n][1]]
        if not holds:
            return self.bad  # unknown before the first hold
        if holds[-1] == now:
            self.bad = 0
            return 0
        begin = holds[-1] + 1
        toggles = [n for n in range(max(begin, now - 3 * self.most), now + 1) if self.seen[n][0] != self.seen[n - 1][0]]
        if toggles and toggles[-1] == now and len(toggles) > 1 and now - toggles[-2] < self.least:
            self.bad = 1
        since = toggles[-1] if toggles else begin - 1
        if now - since >= self.most:
            self.bad = 1
        return self.bad


def sizes() -> tuple[int, int, int]:
    """BeatCycles, LeastCycles, MostCycles of the build."""
    beat, least, most = map(int, os.environ["MONITOR_SIZES"].split())
    return beat, least, most


async def power_on(dut: Any) -> None:
    """The clock runs, the block is held, nothing beats."""
    dut.beat_i.value = 0
    Clock(dut.clk_i, PERIOD_NS, unit="ns").start()
    await hold(dut)


async def hold(dut: Any) -> None:
    dut.hold_i.value = 1
    for _ in range(SYNC_EDGES + 2):
        await FallingEdge(dut.clk_i)
    assert dut.bad_o.value == 0


async def watch(dut: Any) -> None:
    """Held before, so that nothing is known of the beat."""
    await hold(dut)
    dut.hold_i.value = 0


async def beats(dut: Any, interval_ns: float, count: int) -> None:
    """Toggles at a mean interval, each at its own thousandth of a clock; the beat has been there before."""
    at = random.random() * interval_ns
    waited = 0
    for n in range(count):
        await Timer(max(1, math.floor(at + n * interval_ns) - waited), "ns")
        waited = math.floor(at + n * interval_ns)
        dut.beat_i.value = 1 - int(dut.beat_i.value)


@cocotb.test
async def bad_from_configuration_on(dut: Any) -> None:
    """High until it has been held: a monitor whose clock never came permits nothing."""
    dut.beat_i.value, dut.hold_i.value = 0, 0
    dut.u_hold.meta_q.value, dut.u_hold.sync_q.value = 0, 0  # as configuration leaves them
    await Timer(10, "ns")
    assert dut.bad_o.value == 1
    Clock(dut.clk_i, PERIOD_NS, unit="ns").start()
    for _ in range(200):
        await FallingEdge(dut.clk_i)
        assert dut.bad_o.value == 1
    dut.hold_i.value = 1
    for _ in range(SYNC_EDGES + 1):
        await FallingEdge(dut.clk_i)
    assert dut.bad_o.value == 0


@cocotb.test
@cocotb.parametrize(seed=list(range(4)))
async def model(dut: Any, seed: int) -> None:
    """Intervals about both limits, pauses and holds at random, at any time: as the model says after every edge."""
    _, least, most = sizes()
    rng = random.Random(seed)
    await power_on(dut)
    known = Model(least, most)
    for _ in range(4):
        known.edge(0, 1)
    await RisingEdge(dut.clk_i)
    await Timer(1, "ns")
    changes: set[int] = set()
    beat, hold, left, bads = 0, 1, 5, 0
    for edge in range(6000):
        await Timer(rng.randrange(1, PERIOD_NS - 1), "ns")  # in either half of the clock
        dut.beat_i.value, dut.hold_i.value = beat, hold
        await RisingEdge(dut.clk_i)
        await Timer(1, "ns")
        expected = known.edge(beat, hold)
        assert int(dut.bad_o.value) == expected, f"edge {edge}: {dut.bad_o.value}, {expected} by the model"
        bads += expected
        left -= 1
        hold = int(rng.random() < (0.05 if known.bad else 0.0005))
        if left <= 0:
            beat ^= 1
            changes.add(beat)
            middle = rng.randint(least, most)
            left = rng.choices([least, most, middle, least - 1, most + 1, 1, 3 * most], [9, 9, 60, 1, 1, 1, 1])[0]
    assert changes == {0, 1} and 0 < bads < 6000


@cocotb.test
async def clocks_within_the_tolerance_are_good(dut: Any) -> None:
    """Both ends of the oscillator's tolerance, with beats at every place between two edges."""
    beat_cycles, least, most = sizes()
    await power_on(dut)
    for board in BOARDS:
        for share in (1 - board.tolerance, 1.0, 1 + board.tolerance):
            clocks = beat_cycles * board.osc_hz * share / board.clock_hz
            if (least, most) == limits(board)[2:]:
                clocks = beat_cycles**2 / clocks
            elif (least, most) != limits(board)[:2]:
                continue
            await watch(dut)
            await beats(dut, PERIOD_NS * clocks, 400)
            assert dut.bad_o.value == 0, f"{board.top}: oscillator at {share}"


@cocotb.test
async def clocks_beyond_the_limits_are_found(dut: Any) -> None:
    """A beat two clocks longer or shorter than the limits, at any place between two edges: found within two beats."""
    _, least, most = sizes()
    await power_on(dut)
    for clocks in (most + 2.0, 2.0 * most, *(fast for fast in (least - 2.0, 0.5 * least) if fast >= 1.0)):
        await watch(dut)
        await beats(dut, PERIOD_NS * clocks, 8)
        assert dut.bad_o.value == 1, clocks


@cocotb.test
async def clock_that_stops_is_found_and_kept(dut: Any) -> None:
    """Within its time of the last toggle, at either level; it stays when the clock is back, until the block is held."""
    _, least, most = sizes()
    longest = 0
    await power_on(dut)
    for _ in range(40):
        await watch(dut)
        good = random.uniform(least + 1.0, most - 1.0) if most - least > 2 else (least + most) / 2
        await beats(dut, PERIOD_NS * good, random.randrange(2, 9))
        edges = 0
        while dut.bad_o.value == 0:
            await RisingEdge(dut.clk_i)
            await Timer(1, "ns")
            edges += 1
            assert edges <= most + TOGGLE_TO_BAD
        longest = max(longest, edges)
        await beats(dut, PERIOD_NS * good, 5)
        assert dut.bad_o.value == 1
    assert longest >= most + SYNC_EDGES


@cocotb.test
async def gives_its_own_beat(dut: Any) -> None:
    """Every BeatCycles clocks, held or not."""
    beat_cycles = sizes()[0]
    await power_on(dut)
    edges, before = [], int(dut.beat_o.value)
    for n in range(6 * beat_cycles):
        dut.hold_i.value = int(n < 3 * beat_cycles)
        await RisingEdge(dut.clk_i)
        await Timer(1, "ns")
        if int(dut.beat_o.value) != before:
            edges.append(n)
            before = int(dut.beat_o.value)
        await FallingEdge(dut.clk_i)
        await Timer(1, "ns")
        assert int(dut.beat_o.value) == before, "a beat beside the rising edge"
    assert {b - a for a, b in pairwise(edges)} == {beat_cycles} and len(edges) >= 5


@pytest.mark.parametrize(("beat", "least", "most"), [(64, 41, 59), (64, 40, 126), (64, 70, 99), (2, 2, 3), (4, 7, 8)])
def test_fl_clock_monitor(beat: int, least: int, most: int) -> None:
    """Limits of both boards and the smallest ones: model, clocks at and beyond the limits, a clock that stops.

    Verifies: CLK-01
    """
    parameters = {"BeatCycles": beat, "LeastCycles": least, "MostCycles": most}
    sources = ["common/fl_sync.sv", "safety/fl_clock_monitor.sv"]
    sizes_env = {"MONITOR_SIZES": f"{beat} {least} {most}"}
    run_block_test("fl_clock_monitor", sources, __name__, parameters=parameters, extra_env=sizes_env, seen=["fl_sync"])
