# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Test bench of the blocks behind the register bus: clock, reset, bus master.

Inputs change at the falling edge.
"""

from __future__ import annotations

from typing import Any

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import ClockCycles, FallingEdge, First, Timer
from cocotb.utils import get_sim_time

CLOCK_NS = 20


def request(adr: int, wdat: int = 0, we: bool = False, sel: int = 0xF) -> int:
    """A `fl_bus_pkg::bus_req_t` as an integer."""
    return (int(we) << 48) | (adr << 36) | (wdat << 4) | sel


class Bench:
    """Clock and reset of a block, and its register bus if it has one."""

    def __init__(self, dut: Any) -> None:
        self.dut = dut
        self.has_bus = hasattr(dut, "req_i")
        self.has_clock = False

    async def start(self, **inputs: int) -> None:
        """Start the clock if it stands, hold reset for 3 clocks with the given inputs, return at a falling edge."""
        if not self.has_clock:
            cocotb.start_soon(Clock(self.dut.clk_i, CLOCK_NS, unit="ns").start())
            self.has_clock = True
        for name, value in inputs.items():
            getattr(self.dut, name).value = value
        if self.has_bus:
            self.dut.req_i.value = 0
            self.dut.stb_i.value = 0
        self.dut.rst_i.value = 1
        await ClockCycles(self.dut.clk_i, 3)
        await FallingEdge(self.dut.clk_i)
        self.dut.rst_i.value = 0

    async def clocks(self, count: int = 1) -> None:
        """Let `count` rising edges pass."""
        for _ in range(count):
            await FallingEdge(self.dut.clk_i)

    async def sleep(self, count: int, wake: Any) -> int:
        """Let at most `count` rising edges pass, asleep until the trigger `wake`; how many have passed by then.

        For long times: a clock costs a tenth of one in `clocks`.
        """
        start_ns = get_sim_time("ns")
        await First(wake, Timer(count * CLOCK_NS, "ns"))
        passed = round((get_sim_time("ns") - start_ns + CLOCK_NS / 2) // CLOCK_NS)
        await FallingEdge(self.dut.clk_i)
        return passed

    async def write(self, adr: int, value: int, sel: int = 0xF) -> None:
        """Write a register; the write is done at the rising edge inside this call."""
        self.dut.req_i.value = request(adr, value, we=True, sel=sel)
        self.dut.stb_i.value = 1
        await self.clocks()
        self.dut.stb_i.value = 0

    async def read(self, adr: int) -> int:
        """Read a register as the interconnect does: strobe for one clock, take the data at its end."""
        self.dut.req_i.value = request(adr)
        self.dut.stb_i.value = 1
        # The answer is combinational; a quarter of a clock is enough for it and well before the edge.
        await cocotb.triggers.Timer(CLOCK_NS // 4, "ns")
        value = int(self.dut.rdat_o.value)
        await self.clocks()
        self.dut.stb_i.value = 0
        return value

    async def wait_high(self, signal: Any, limit: int) -> int:
        """Clocks until `signal` is high, seen at falling edges; fails after `limit`."""
        for count in range(limit + 1):
            if signal.value == 1:
                return count
            await self.clocks()
        raise AssertionError(f"{signal._name} did not rise within {limit} clocks")
