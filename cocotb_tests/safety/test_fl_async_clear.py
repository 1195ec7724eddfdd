# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A level that is cleared without a clock: with none, by pulses that no edge sees; back after its number of edges."""

from __future__ import annotations

import random
from typing import Any

import cocotb
import pytest
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, RisingEdge, Timer

from fluxlock.cosim.block import run_block_test


async def edges(dut: Any, count: int) -> None:
    for _ in range(count):
        await RisingEdge(dut.clk_i)
    await Timer(1, "ns")


@cocotb.test
async def needs_no_clock(dut: Any) -> None:
    """Cleared while the clock stands, at either level, and it stays when the input has gone."""
    stages = int(dut.Stages.value)
    dut.clear_i.value, dut.ok_i.value, dut.clk_i.value = 0, 1, 0
    for level in (0, 1):
        for _ in range(2 * stages + 1):
            dut.clk_i.value = 1 - int(dut.clk_i.value)
            await Timer(5, "ns")
            dut.clk_i.value = 1 - int(dut.clk_i.value)
            await Timer(5, "ns")
        dut.clk_i.value = level
        await Timer(50, "ns")
        assert dut.ok_o.value == 1
        dut.clear_i.value = 1
        await Timer(1, "ns")
        assert dut.ok_o.value == 0
        dut.clear_i.value = 0
        await Timer(500, "ns")
        assert dut.ok_o.value == 0


@cocotb.test
async def comes_back_with_the_clock(dut: Any) -> None:
    """Off at once by pulses of a nanosecond, on again at the given edge, later for each edge without ok_i."""
    stages = int(dut.Stages.value)
    dut.clear_i.value, dut.ok_i.value = 0, 1
    Clock(dut.clk_i, 20, unit="ns").start()
    for _ in range(50):
        await edges(dut, stages + 2)
        assert dut.ok_o.value == 1
        await Timer(random.randrange(1, 17), "ns")
        dut.clear_i.value = 1
        await Timer(1, "ns")
        assert dut.ok_o.value == 0
        dut.clear_i.value = 0
        waits = random.randrange(3)
        dut.ok_i.value = int(waits == 0)
        for _ in range(waits):
            await edges(dut, 1)
            assert dut.ok_o.value == 0
        dut.ok_i.value = 1
        for _ in range(stages - 1):
            await edges(dut, 1)
            assert dut.ok_o.value == 0
        await edges(dut, 1)
        assert dut.ok_o.value == 1
    dut.ok_i.value = 0
    await edges(dut, stages - 1)
    assert dut.ok_o.value == 1
    await edges(dut, 1)
    assert dut.ok_o.value == 0
    await FallingEdge(dut.clk_i)


@pytest.mark.parametrize("stages", [1, 2, 4])
def test_fl_async_clear(stages: int) -> None:
    """Without a clock, by short pulses, and back.

    Verifies: CLK-02, CLK-03
    """
    run_block_test("fl_async_clear", ["safety/fl_async_clear.sv"], __name__, parameters={"Stages": stages})
