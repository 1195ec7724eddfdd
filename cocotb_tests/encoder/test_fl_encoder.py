# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Encoder decoder against a rotor that knows where it is: pins made from its place, the position compared."""

from __future__ import annotations

import random
from typing import Any

import cocotb
import pytest
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, Timer

from fluxlock.cosim.block import run_block_test

CLOCK_NS = 20
LATENCY = 3  # clocks from pin to position besides the filter, published by the module
SETTLE = 530  # clocks after reset in which the pins only set the quarter
SOURCES = ["common/fl_sync.sv", "encoder/fl_encoder.sv"]


def pins(place: int, quarters: int, index: bool = True) -> int:
    """Z, B, A in bits 2, 1, 0 at a place in quarters (any integer)."""
    a, b = ((1, 0), (1, 1), (0, 1), (0, 0))[place % 4]
    return a | b << 1 | (index and place % quarters == 0) << 2


class TB:
    """Rotor with an encoder; `place` counts quarters from the index."""

    def __init__(self, dut: Any, quarters: int, filter_cycles: int) -> None:
        self.dut = dut
        self.quarters, self.filter = quarters, filter_cycles
        self.delay = LATENCY + max(1, filter_cycles)
        self.place = 0

    async def clocks(self, n: int) -> None:
        if n > 0:
            await Timer(n * CLOCK_NS, "ns")

    async def start(self, place: int, *, index: bool = True) -> None:
        dut = self.dut
        Clock(dut.clk_i, CLOCK_NS, unit="ns").start()
        self.place = place
        dut.encoder_i.value = pins(place, self.quarters, index)
        dut.cfg_filter_i.value, dut.cfg_last_i.value = self.filter, self.quarters - 1
        dut.cfg_index_i.value = index
        dut.rst_i.value = 1
        await FallingEdge(dut.clk_i)
        await self.clocks(3)
        dut.rst_i.value = 0
        await self.clocks(SETTLE)

    def turn(self, step: int, *, index: bool = True) -> None:
        """Put the rotor a number of quarters further."""
        self.place += step
        self.dut.encoder_i.value = pins(self.place, self.quarters, index)

    @property
    def position(self) -> int:
        return int(self.dut.position_o.value)

    @property
    def counts(self) -> tuple[int, int]:
        return int(self.dut.invalid_o.value), int(self.dut.strayed_o.value)


@cocotb.test()
@cocotb.parametrize(quarters=[4, 4096, 1 << 18], filter_cycles=[0, 2, 5])
async def position_follows_the_rotor(dut: Any, quarters: int, filter_cycles: int) -> None:
    """Random walk with runs either way and edges as close as the filter allows: exact position, exact latency.

    Until Z has been seen the position differs from the place by a constant; from then on they are equal.

    Verifies: ENC-01, ENC-02
    """
    rng = random.Random(quarters + filter_cycles)
    tb = TB(dut, quarters, filter_cycles)
    await tb.start(rng.choice([1, 2, 3]) if quarters == 4 else 7)
    lost = tb.place - tb.position
    assert int(dut.indexed_o.value) == 0
    history = [tb.place] * (tb.delay + 1)
    direction, wait, seen_at = -1, 0, None
    for clock in range(6000):
        if wait == 0:
            if clock > 200 and rng.random() < 0.02:
                direction = -direction
            tb.turn(direction)
            wait = rng.choice([max(1, filter_cycles), max(1, filter_cycles), rng.randint(max(1, filter_cycles), 40)])
        wait -= 1
        await tb.clocks(1)
        history.append(tb.place)
        then = history[-tb.delay]
        if seen_at is None and then % quarters == 0:
            seen_at = clock
        if seen_at is None:
            assert tb.position == (then - lost) % quarters, f"clock {clock}"
        elif clock > seen_at + 1:
            assert int(dut.indexed_o.value) == 1
            assert tb.position == then % quarters, f"clock {clock}: {tb.position}, place {then}"
    assert seen_at is not None
    assert tb.counts == (0, 0)


@cocotb.test()
async def without_index_it_counts_on(dut: Any) -> None:
    """With Z switched off pulses of Z do nothing; the position goes round both ways, the direction is told.

    Verifies: ENC-01
    """
    tb = TB(dut, 8, 1)
    await tb.start(3, index=False)
    begin = tb.position
    for step in [1] * 20 + [-1] * 30:
        tb.turn(step, index=True)
        await tb.clocks(6)
        assert tb.position == (begin + tb.place - 3) % 8
        assert int(dut.backward_o.value) == (step < 0)
    assert int(dut.indexed_o.value) == 0
    assert tb.counts == (0, 0)


@cocotb.test()
@cocotb.parametrize(filter_cycles=[2, 7])
async def short_glitches_are_ignored(dut: Any, filter_cycles: int) -> None:
    """A level that lasts less than the filter counts nothing, on any pin, whatever comes right after it.

    Verifies: ENC-03
    """
    rng = random.Random(filter_cycles)
    tb = TB(dut, 64, filter_cycles)
    await tb.start(0)
    for _ in range(300):
        before = tb.position
        level = pins(tb.place, 64)
        dut.encoder_i.value = level ^ rng.randint(1, 7)
        await tb.clocks(rng.randint(1, filter_cycles - 1))
        dut.encoder_i.value = level
        await tb.clocks(rng.randint(1, 3))
        dut.encoder_i.value = level ^ rng.randint(1, 7)
        await tb.clocks(rng.randint(1, filter_cycles - 1))
        dut.encoder_i.value = level
        await tb.clocks(tb.delay + 2)
        assert tb.position == before
        tb.turn(rng.choice([1, -1]))
        await tb.clocks(tb.delay + 1)
        assert tb.position == tb.place % 64
    assert tb.counts == (0, 0)


@cocotb.test()
async def lost_steps_are_counted_and_set_right_by_the_index(dut: Any) -> None:
    """Both tracks at once: counted, the position stays two quarters behind until Z, which counts as strayed once.

    Verifies: ENC-02, ENC-04
    """
    tb = TB(dut, 40, 1)
    await tb.start(0)
    for lost in range(1, 4):
        for _ in range(10):
            tb.turn(1)
            await tb.clocks(8)
        tb.turn(2)
        await tb.clocks(8)
        assert tb.counts == (lost, lost - 1)
        assert tb.position == (tb.place - 2) % 40
        while tb.place % 40:
            tb.turn(1)
            await tb.clocks(8)
        assert tb.counts == (lost, lost)
        assert tb.position == 0


@pytest.mark.parametrize("module", ["fl_encoder"])
def test_fl_encoder(module: str) -> None:
    """Encoder block test."""
    run_block_test(module, SOURCES, __name__)
