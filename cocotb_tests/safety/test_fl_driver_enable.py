# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Enable that toggles: its edges with permits of any length, against the time since the permit."""

from __future__ import annotations

import os
import random
from typing import Any

import cocotb
import pytest
from cocotb.triggers import FallingEdge

from cocotb_tests.soc.bench import Bench
from fluxlock.cosim.block import run_block_test


@cocotb.test
async def toggles_with_the_permit_alone(dut: Any) -> None:
    half = int(os.environ["HALF_CYCLES"])
    bench = Bench(dut)
    await bench.start(permit_i=0)
    edges = 0
    for permit in [0, 1] * 60:
        for since in range(1, random.randrange(2, 6 * half)):
            dut.permit_i.value = permit
            before = int(dut.toggle_o.value)
            await FallingEdge(dut.clk_i)
            expected = permit and since // half % 2
            assert int(dut.toggle_o.value) == expected, f"{since} clocks after permit {permit}"
            edges += before != expected
    assert edges > 60


@pytest.mark.parametrize("half", [64, 2, 5])
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
