# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Square root against the integer one of Python."""

from __future__ import annotations

import random
from math import isqrt
from typing import Any

import cocotb
import pytest
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, Timer

from fluxlock.cosim.block import run_block_test

CLOCK_NS = 20


@cocotb.test()
async def root_is_exact(dut: Any) -> None:
    """Squares, their neighbours, extremes and random radicands, after exactly Latency clocks; a start replaces.

    Verifies: FOC-09
    """
    rng = random.Random(1)
    bits = len(dut.root_o.value)
    latency = (bits + 2) // 3
    dut.start_i.value = 0
    dut.rst_i.value = 1
    Clock(dut.clk_i, CLOCK_NS, unit="ns").start()
    await FallingEdge(dut.clk_i)
    await Timer(3 * CLOCK_NS, "ns")
    dut.rst_i.value = 0
    top = (1 << 2 * bits) - 1
    for _ in range(1500):
        square = rng.randrange(1 << bits) ** 2
        radicand = max(0, min(top, rng.choice([0, top, square - 1, square, square + 1, rng.randrange(top + 1)])))
        if rng.random() < 0.1:
            dut.radicand_i.value = rng.randrange(top + 1)
            dut.start_i.value = 1
            await Timer(rng.randint(1, max(1, latency - 1)) * CLOCK_NS, "ns")
        dut.radicand_i.value = radicand
        dut.start_i.value = 1
        await Timer(CLOCK_NS, "ns")
        dut.start_i.value = 0
        dut.radicand_i.value = 1
        for _ in range(latency - 1):
            assert int(dut.valid_o.value) == 0
            await Timer(CLOCK_NS, "ns")
        assert int(dut.valid_o.value) == 1
        assert int(dut.root_o.value) == isqrt(radicand), f"of {radicand}"
        await Timer(CLOCK_NS, "ns")
        assert int(dut.valid_o.value) == 0


@pytest.mark.parametrize("bits", [20, 7, 2])
def test_fl_sqrt(bits: int) -> None:
    """Square root block test over widths."""
    run_block_test("fl_sqrt", ["foc/fl_sqrt.sv"], __name__, parameters={"RootBits": bits})
