# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Enable that toggles: its edges with permits of any length, against the time since the permit."""

from __future__ import annotations

import os
import random
from typing import Any

import cocotb
import pytest
from cocotb.triggers import FallingEdge, RisingEdge, Timer

from cocotb_tests.soc.bench import Bench
from fluxlock.cosim.block import run_block_test


@cocotb.test
async def toggles_with_the_permit_alone(dut: Any) -> None:
    """Expected after each rising edge, and unchanged at the falling one; a reset ends a permit too.

    Permit and reset change in either half of a clock: a register that falling edges clock is found.
    """
    half = int(os.environ["HALF_CYCLES"])
    bench = Bench(dut)
    await bench.start(permit_i=0)
    edges, before = 0, 0
    for n in range(240):
        dut.permit_i.value, dut.rst_i.value = n % 2, int(n % 2 == 0 and n % 3 == 0)
        if n % 6 == 4:
            dut.permit_i.value, dut.rst_i.value = 1, 1
        clocks = random.choice((1, half - 1, half, random.randrange(1, 7 * half)))
        early = random.randrange(2)
        for since in range(1, clocks + 1):
            await RisingEdge(dut.clk_i)
            await Timer(1, "ns")
            expected = int(n % 2 and since // half % 2)
            assert int(dut.toggle_o.value) == expected, f"{since} clocks after permit {n % 2}"
            edges += before != expected
            before = expected
            if early and since == clocks:
                break
            await FallingEdge(dut.clk_i)
            await Timer(1, "ns")
            assert int(dut.toggle_o.value) == expected
    assert edges > 60


@pytest.mark.parametrize("half", [64, 2, 3, 5])
def test_fl_driver_enable(half: int) -> None:
    """Edges at their distance, none without permit.

    Verifies: CLK-04
    """
    run_block_test(
        "fl_driver_enable",
        ["safety/fl_driver_enable.sv"],
        __name__,
        parameters={"HalfCycles": half},
        extra_env={"HALF_CYCLES": str(half)},
    )
