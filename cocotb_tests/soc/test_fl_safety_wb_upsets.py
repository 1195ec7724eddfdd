# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Bits that flip in the two guards behind the register bus, up to the pins."""

from __future__ import annotations

import random
from typing import Any

import cocotb
import pytest
from cocotb.triggers import Timer

from cocotb_tests.soc.test_fl_safety_wb import DEAD_TIME, TB, build_arguments
from fluxlock.cosim.block import run_block_test

GUARD_REGISTERS = ("gate_h_q", "gate_l_q", "block_h_q", "block_l_q", "wait_q")


@cocotb.test
async def upset_of_a_guard_is_safe(dut: Any) -> None:
    """Any bit of either guard flips, at any time of the dead time: never both gates, no gap shorter than it is."""
    tb = TB(dut)
    await tb.begin()
    dead_time = 30
    await tb.write(DEAD_TIME, dead_time)
    await tb.enable()
    off_since = {}  # clocks since each gate of a leg went off, 2 X upper, 2 X + 1 lower one of leg X
    shortest, turns = 1 << 30, 0

    async def clocks(count: int) -> None:
        """Watch the pins between the clock edges, where a flipped bit shows, and after them."""
        nonlocal shortest, turns
        for _ in range(count):
            tb.on()
            await tb.clocks()
            pins = tb.pins()
            for gate in range(6):
                if pins[gate & 1] >> gate // 2 & 1:
                    shortest = min(shortest, off_since.get(gate ^ 1, 1 << 30))
                    turns += off_since.pop(gate, None) is not None
                    off_since[gate] = 0
                elif gate in off_since:
                    off_since[gate] += 1

    await clocks(1100)
    flips = [
        (n, name, bit) for n in range(2) for name in GUARD_REGISTERS for bit in range(30 if name == "wait_q" else 3)
    ]
    for _ in range(6):
        random.shuffle(flips)
        for n, name, bit in flips:
            dut.req_h_i.value = random.getrandbits(3)
            dut.req_l_i.value = ~int(dut.req_h_i.value) & 7
            await clocks(random.randrange(dead_time + 5))
            register = getattr(dut.g_guard[n].u_guard, name)
            register.value = int(register.value) ^ 1 << bit
            await Timer(1, "ns")
            await clocks(dead_time + random.randrange(5))  # one flipped bit at a time: this guard has counted again
    assert turns > 500, "gates have hardly switched"
    assert shortest >= dead_time, f"gap of {shortest} clocks"


@pytest.mark.parametrize("polarity", [0, 3])
def test_guard_upsets(polarity: int) -> None:
    """Every flip-flop of both guards; the assertions of the guard that is upset may break.

    Verifies: SAFE-22
    """
    # g_guard[n] has an index only where every signal is kept.
    arguments = {**build_arguments(polarity), "seen": ["*"]}
    run_block_test("fl_safety_wb", test_module=__name__, assertions=False, **arguments)
