# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Clock and reset of an injection block. Inputs change at the falling edge."""

from __future__ import annotations

from typing import Any

from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, Timer

CLOCK_NS = 20


class Bench:
    def __init__(self, dut: Any) -> None:
        self.dut = dut

    async def clocks(self, n: int) -> None:
        if n:
            await Timer(n * CLOCK_NS, "ns")

    async def reset(self, *idle: str, **inputs: int) -> None:
        """Start the clock, hold reset for 3 clocks with the named ports at 0 and the given inputs, wait one more."""
        Clock(self.dut.clk_i, CLOCK_NS, unit="ns").start()
        for name, value in (dict.fromkeys(idle, 0) | inputs).items():
            getattr(self.dut, name).value = value
        self.dut.rst_i.value = 1
        await FallingEdge(self.dut.clk_i)
        await self.clocks(3)
        self.dut.rst_i.value = 0
        await self.clocks(1)

    async def clear(self) -> None:
        self.dut.clear_i.value = 1
        await self.clocks(1)
        self.dut.clear_i.value = 0
