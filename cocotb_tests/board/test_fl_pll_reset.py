# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Reset of the PLL: with every loss of its lock, again and again until it locks, none with the lock."""

from __future__ import annotations

import random
from typing import Any

import cocotb
import pytest
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, RisingEdge, Timer

from fluxlock.cosim.block import run_block_test

LOSS_TO_RESET = 3  # clock edges, at most
PERIOD_NS = 26


async def begin(dut: Any, locked: int) -> None:
    dut.locked_i.value = locked
    Clock(dut.clk_i, PERIOD_NS, unit="ns").start()
    for _ in range(4 * int(dut.RepeatCycles.value) if locked else 4):
        await FallingEdge(dut.clk_i)


@cocotb.test
async def repeats_until_the_lock_is_there(dut: Any) -> None:
    """PulseCycles of every RepeatCycles clocks."""
    pulse, repeat = int(dut.PulseCycles.value), int(dut.RepeatCycles.value)
    await begin(dut, 1)
    dut.locked_i.value = 0
    levels = []
    for _ in range(5 * repeat):
        await FallingEdge(dut.clk_i)
        levels.append(int(dut.rst_o.value))
    first = levels.index(1)
    assert first < LOSS_TO_RESET
    assert levels[first:] == [int(n % repeat < pulse) for n in range(len(levels) - first)]
    dut.locked_i.value = 1
    for _ in range(LOSS_TO_RESET + pulse):
        await FallingEdge(dut.clk_i)
    for _ in range(2 * repeat):
        await FallingEdge(dut.clk_i)
        assert dut.rst_o.value == 0


@cocotb.test
async def loss_of_any_length_resets(dut: Any) -> None:
    """One that no clock edge has seen, too, wherever between two of them: a whole pulse."""
    await begin(dut, 1)
    for _ in range(40):
        await RisingEdge(dut.clk_i)
        await Timer(random.randrange(1, PERIOD_NS - 1), "ns")
        dut.locked_i.value = 0
        await Timer(1, "ns")
        dut.locked_i.value = 1
        seen = 0
        for _ in range(LOSS_TO_RESET + int(dut.PulseCycles.value)):
            await FallingEdge(dut.clk_i)
            seen += int(dut.rst_o.value)
        assert seen == int(dut.PulseCycles.value), f"{seen} clocks of reset"
        await FallingEdge(dut.clk_i)
        assert dut.rst_o.value == 0


@cocotb.test
async def lock_comes_and_goes_at_any_time(dut: Any) -> None:
    """A lock counts from the third edge on; one in the pause ends it, so that the next loss has its pulse at once."""
    pulse, repeat = int(dut.PulseCycles.value), int(dut.RepeatCycles.value)
    await begin(dut, 1)
    edges, count = 2, 0  # since the lock is there; of the period that a loss has begun
    change_in = 0
    for _ in range(300 * repeat):
        await RisingEdge(dut.clk_i)
        idle = edges >= 2 and (count == 0 or count >= pulse)
        expected = not idle and count < pulse
        count = 0 if idle else (count + 1) % repeat
        edges += int(dut.locked_i.value)
        await Timer(random.randrange(1, PERIOD_NS - 2), "ns")
        assert int(dut.rst_o.value) == expected
        if change_in == 0:
            dut.locked_i.value = 1 - int(dut.locked_i.value)
            edges = 0
            change_in = random.choice([0, 1, 2, random.randrange(repeat), random.randrange(3 * repeat)])
        else:
            change_in -= 1


@pytest.mark.parametrize(("pulse", "repeat"), [(5, 16), (8, 9), (2, 3)])
def test_fl_pll_reset(pulse: int, repeat: int) -> None:
    """Pulse and pause of several lengths, losses of any length, a lock that comes and goes.

    Verifies: CLK-05
    """
    sources = ["safety/fl_async_clear.sv", "board/fl_pll_reset.sv"]
    run_block_test("fl_pll_reset", sources, __name__, parameters={"PulseCycles": pulse, "RepeatCycles": repeat})
