# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Leg carriers, scheduler, sensing and current window together: samples anywhere in the carrier, and how late they are.

The bench is the converter; its codes ramp with the time of the strobe, so that a mean tells the instant that it is of.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cocotb
import pytest
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, ReadOnly

from cocotb_tests.sense.test_fl_current_window import mean
from fluxlock.base.paths import ROOT
from fluxlock.cosim.block import run_block_test

CARRIER, ONCE = 2, 3  # fl_pkg::sched_mode_e
CONVERSION = 11  # clocks from the strobe to the codes
PERIOD = 400
SOURCES = [
    "pwm/fl_leg_carrier.sv",
    "sense/fl_sample_scheduler.sv",
    "sense/fl_auto_zero.sv",
    "sense/fl_sense.sv",
    "sense/fl_current_window.sv",
    ROOT / "cocotb_tests" / "sense" / "fl_window_chain.sv",
]


def current(strobe: int, x: int) -> int:
    """Corrected current of phase x for a strobe at a time: a code counts 64."""
    return 64 * (strobe % 1000 - 500 + 7 * x)


@dataclass(frozen=True)
class Output:
    """One result: clock, currents, its instant and the number of samples."""

    clock: int
    currents: tuple[int, ...]
    time: int
    samples: int


class TB:
    """Converter, settings and a record by the chip's own time."""

    def __init__(self, dut: Any) -> None:
        self.dut = dut
        self.phases = len(dut.current_o.value) // 18
        self.channels = 2 * self.phases + 3

    async def start(self) -> None:
        settings = {"cfg_double_i": 0, "cfg_period_i": PERIOD, "cfg_mode_i": ONCE, "cfg_spacing_i": 16}
        settings |= {"cfg_offset_i": 0, "cfg_from_i": 0, "cfg_length_i": 0, "cfg_delay_i": 0}
        for name, value in {**settings, "adc_valid_i": 0, "adc_code_i": 0, "rst_i": 1}.items():
            getattr(self.dut, name).value = value
        Clock(self.dut.clk_i, 20, "ns").start()
        for _ in range(3):
            await FallingEdge(self.dut.clk_i)
        self.dut.rst_i.value = 0
        self.strobes: list[int] = []

    async def run(self, cycles: int) -> tuple[list[int], list[int], list[int], list[Output]]:
        """Times of updates, strobes and instants, and the outputs."""
        dut = self.dut
        updates, strobes, instants, outputs = [], [], [], []
        for _ in range(cycles):
            now = int(dut.now_o.value)
            taken = now - CONVERSION
            dut.adc_valid_i.value = taken in self.strobes
            if taken in self.strobes:
                codes = [0] * self.channels
                for x in range(self.phases):
                    codes[self.phases + x] = 2048 + current(taken, x) // 64
                dut.adc_code_i.value = sum(code << (12 * c) for c, code in enumerate(codes))
            await ReadOnly()
            if int(dut.update_o.value):
                updates.append(now)
            if int(dut.strobe_o.value):
                strobes.append(now)
                self.strobes = [*self.strobes[-4:], now]
            if int(dut.instant_o.value):
                instants.append(now)
            if int(dut.valid_o.value):
                word = int(dut.current_o.value)
                values = [(word >> (18 * x)) & 0x3FFFF for x in range(self.phases)]
                currents = tuple(v - (1 << 18) if v >> 17 else v for v in values)
                outputs.append(Output(now, currents, int(dut.time_o.value), int(dut.samples_o.value)))
            await FallingEdge(dut.clk_i)
        return updates, strobes, instants, outputs


@cocotb.test()
@cocotb.parametrize(length=[0, 1], double=[0, 1])
async def one_sample_at_any_point(dut: Any, length: int, double: int) -> None:
    """One sample an update, anywhere in the carrier: its current, its own instant, a constant latency."""
    tb = TB(dut)
    await tb.start()
    dut.cfg_delay_i.value = delay = 13
    dut.cfg_double_i.value = double
    dut.cfg_length_i.value = length
    await tb.run(2 * PERIOD)
    step = PERIOD // (1 + double)
    latency = CONVERSION + tb.phases + 4 + (8 if length else 1)
    for offset in (0, 1, step // 4, step // 2, 3 * step // 4, step - 1):
        dut.cfg_offset_i.value = offset
        dut.cfg_from_i.value = offset if length else 0
        await tb.run(2 * PERIOD)
        updates, strobes, instants, outputs = await tb.run(5 * PERIOD)
        assert len(updates) == 5 * (1 + double) and len(outputs) == len(updates)
        # The strobe is a register behind the update.
        assert all((s - u - 1 - offset) % step == 0 for s in strobes for u in updates)
        assert instants == strobes, f"offset {offset}: instants {instants}, strobes {strobes}"
        for out in outputs:
            strobe = out.clock - latency
            assert out.time == strobe - delay and out.samples == 1
            assert out.currents == tuple(current(strobe, x) for x in range(tb.phases))
            assert (strobe - updates[0] - 1 - offset) % step == 0


@cocotb.test()
@cocotb.parametrize(spacing=[16, 25])
async def means_have_the_instant_of_their_samples(dut: Any, spacing: int) -> None:
    """A window by the rule of the page: n samples, the instant is their mean, the latency that of the last sample."""
    tb = TB(dut)
    await tb.start()
    dut.cfg_mode_i.value = CARRIER
    dut.cfg_spacing_i.value = spacing
    dut.cfg_delay_i.value = delay = 5
    for offset, n in ((spacing, 1), (40, 3), (40, 4), (61, 8), (2 * spacing, 12), (30, 13)):
        dut.cfg_offset_i.value = offset
        dut.cfg_from_i.value = offset
        dut.cfg_length_i.value = length = (n - 1) * spacing + 1
        assert offset + length < PERIOD
        await tb.run(2 * PERIOD)
        updates, strobes, instants, outputs = await tb.run(4 * PERIOD)
        assert len(outputs) >= 3
        for out in outputs[1:]:
            last = out.clock - (CONVERSION + tb.phases + 4 + 8)
            inside = [last - k * spacing for k in range(n)]
            assert last in strobes and (inside[-1] - 1 - offset - updates[0]) % PERIOD == 0
            assert out.samples == n
            assert abs(out.time + delay - sum(inside) / n) <= 0.5 and out.time + delay in instants
            assert out.currents == tuple(mean([current(t, x) for t in inside]) for x in range(tb.phases))


@pytest.mark.parametrize("phases", [3, 5])
def test_window_chain(phases: int) -> None:
    """Samples and means of the vector path.

    Verifies: WIN-01, WIN-03, WIN-05
    """
    run_block_test("fl_window_chain", SOURCES, __name__, parameters={"Phases": phases})
