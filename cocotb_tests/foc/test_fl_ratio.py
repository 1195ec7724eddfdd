# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Ratio against the integer division of Python."""

from __future__ import annotations

import random
from typing import Any

import cocotb
import pytest
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, Timer

from fluxlock.cosim.block import run_block_test

CLOCK_NS = 20


@cocotb.test()
async def ratio_is_exact(dut: Any) -> None:
    """Random and extreme operands, after exactly Latency clocks; a part not below the whole is told; a start replaces.

    Verifies: FOC-09
    """
    rng = random.Random(1)
    bits, ratio_bits = len(dut.whole_i.value), len(dut.ratio_o.value)
    latency = (ratio_bits + 3) // 3
    top = (1 << bits) - 1
    dut.start_i.value = 0
    dut.rst_i.value = 1
    Clock(dut.clk_i, CLOCK_NS, unit="ns").start()
    await FallingEdge(dut.clk_i)
    await Timer(3 * CLOCK_NS, "ns")
    dut.rst_i.value = 0
    for _ in range(1500):
        whole = rng.choice([0, 1, top, rng.randint(0, top), rng.randint(0, top) >> rng.randrange(bits)])
        part = rng.choice(
            [0, whole, max(0, whole - 1), rng.randint(0, whole), rng.randint(0, whole), rng.randint(0, top)]
        )
        if rng.random() < 0.1:
            dut.part_i.value, dut.whole_i.value = 0, 1
            dut.start_i.value = 1
            await Timer(rng.randint(1, max(1, latency - 1)) * CLOCK_NS, "ns")
        dut.part_i.value, dut.whole_i.value = part, whole
        dut.start_i.value = 1
        await Timer(CLOCK_NS, "ns")
        dut.start_i.value = 0
        dut.part_i.value, dut.whole_i.value = 1, 2
        for _ in range(latency - 1):
            assert int(dut.valid_o.value) == 0
            await Timer(CLOCK_NS, "ns")
        assert int(dut.valid_o.value) == 1
        assert int(dut.less_o.value) == int(part < whole), f"{part} of {whole}"
        if part < whole:
            assert int(dut.ratio_o.value) == (part << ratio_bits) // whole, f"{part} of {whole}"
        await Timer(CLOCK_NS, "ns")
        assert int(dut.valid_o.value) == 0


@pytest.mark.parametrize(("bits", "ratio_bits"), [(20, 17), (2, 2), (9, 12)])
def test_fl_ratio(bits: int, ratio_bits: int) -> None:
    """Ratio block test over widths."""
    run_block_test("fl_ratio", ["foc/fl_ratio.sv"], __name__, parameters={"WholeBits": bits, "RatioBits": ratio_bits})
