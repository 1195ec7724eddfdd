# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Interpolator against exact fractions."""

from __future__ import annotations

import random
from fractions import Fraction
from math import floor
from typing import Any

import cocotb
import pytest
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, Timer

from fluxlock.cosim.block import run_block_test

CLOCK_NS = 20


@cocotb.test()
async def quotient_is_exact(dut: Any) -> None:
    """Offset = gap * before / (before + after), rounded half up, after exactly Latency clocks.

    Verifies: ZCD-01
    """
    rng = random.Random(1)
    time_bits, value_bits = len(dut.gap_i.value), len(dut.before_i.value)
    latency = time_bits + 3
    dut.start_i.value = 0
    dut.abort_i.value = 0
    dut.rst_i.value = 1
    Clock(dut.clk_i, CLOCK_NS, unit="ns").start()
    await FallingEdge(dut.clk_i)
    await Timer(3 * CLOCK_NS, "ns")
    dut.rst_i.value = 0
    await Timer(CLOCK_NS, "ns")

    def draw(bits: int) -> int:
        return rng.choice([0, 1, (1 << bits) - 1, rng.randrange(1 << bits), rng.randrange(1 << rng.randint(1, bits))])

    for _ in range(1500):
        gap, before, after = draw(time_bits), draw(value_bits), draw(value_bits)
        if before + after == 0:
            continue
        dut.gap_i.value, dut.before_i.value, dut.after_i.value = gap, before, after
        dut.start_i.value = 1
        await Timer(CLOCK_NS, "ns")
        dut.start_i.value = 0
        dut.gap_i.value, dut.before_i.value, dut.after_i.value = 1, 1, 1
        await Timer((latency - 2) * CLOCK_NS, "ns")
        assert int(dut.valid_o.value) == 0 and int(dut.busy_o.value) == 1
        await Timer(CLOCK_NS, "ns")
        assert int(dut.valid_o.value) == 1 and int(dut.busy_o.value) == 0
        expected = floor(Fraction(gap * before, before + after) + Fraction(1, 2))
        assert int(dut.offset_o.value) == expected, f"gap {gap}, before {before}, after {after}"
        await Timer(CLOCK_NS, "ns")
        assert int(dut.valid_o.value) == 0


@cocotb.test()
async def abort_replaces(dut: Any) -> None:
    """A start with abort_i drops what runs, at every clock of it; abort_i alone ends it without a result.

    Verifies: ZCD-01
    """
    time_bits = len(dut.gap_i.value)
    latency = time_bits + 3
    dut.start_i.value = 0
    dut.abort_i.value = 0
    dut.rst_i.value = 1
    Clock(dut.clk_i, CLOCK_NS, unit="ns").start()
    await FallingEdge(dut.clk_i)
    await Timer(3 * CLOCK_NS, "ns")
    dut.rst_i.value = 0
    await Timer(CLOCK_NS, "ns")
    for after in range(1, latency + 2):
        dut.gap_i.value, dut.before_i.value, dut.after_i.value = 3, 0, 1
        dut.start_i.value = 1
        await Timer(CLOCK_NS, "ns")
        dut.start_i.value = 0
        if after > 1:
            await Timer((after - 1) * CLOCK_NS, "ns")
        dut.gap_i.value, dut.before_i.value, dut.after_i.value = 2, 3, 0
        dut.start_i.value = dut.abort_i.value = 1
        await Timer(CLOCK_NS, "ns")
        dut.start_i.value = dut.abort_i.value = 0
        for _ in range(latency - 1):
            assert int(dut.valid_o.value) == 0, f"replaced after {after} clocks"
            await Timer(CLOCK_NS, "ns")
        assert int(dut.valid_o.value) == 1 and int(dut.offset_o.value) == 2
        dut.start_i.value = 1
        await Timer(CLOCK_NS, "ns")
        dut.start_i.value = 0
        if after > 1:
            await Timer((after - 1) * CLOCK_NS, "ns")
        dut.abort_i.value = 1
        await Timer(CLOCK_NS, "ns")
        dut.abort_i.value = 0
        for _ in range(latency):
            assert int(dut.valid_o.value) == 0
            await Timer(CLOCK_NS, "ns")


@pytest.mark.parametrize(("time_bits", "value_bits"), [(16, 17), (2, 2), (7, 9), (8, 8), (9, 3)])
def test_fl_interpolator(time_bits: int, value_bits: int) -> None:
    """Interpolator block test over widths."""
    run_block_test(
        "fl_interpolator",
        ["zcd/fl_interpolator.sv"],
        __name__,
        parameters={"TimeBits": time_bits, "ValueBits": value_bits},
    )
