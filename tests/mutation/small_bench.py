# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Tests of `fl_small` as a block's tests are, with a gap: nothing looks at the reset."""

from __future__ import annotations

from typing import Any

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge


@cocotb.test()
async def delays_by_a_clock(dut: Any) -> None:
    dut.rst_i.value, dut.a_i.value, dut.b_i.value = 0, 0, 0
    Clock(dut.clk_i, 20, "ns").start()
    for a, b in ((1, 0), (1, 1), (0, 1), (0, 0), (1, 0), (0, 1)):
        dut.a_i.value, dut.b_i.value = a, b
        await FallingEdge(dut.clk_i)
        assert dut.y_o.value == a


@cocotb.test()
async def keeps_a_level(dut: Any) -> None:
    """Takes longer than the least time that a test is given."""
    dut.rst_i.value, dut.a_i.value, dut.b_i.value = 0, 1, 0
    Clock(dut.clk_i, 20, "ns").start()
    await FallingEdge(dut.clk_i)
    for _ in range(5000):
        await FallingEdge(dut.clk_i)
        assert dut.y_o.value == 1


@cocotb.test()
async def left_out(_: Any) -> None:
    raise AssertionError("a test that is left out was run")
