# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Bit timing against a clock in continuous time that sees the same edges."""

from __future__ import annotations

import random
from typing import Any

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, Timer

from fluxlock.can.timing import BitClock, BitTiming
from fluxlock.cosim.block import run_block_test

CLOCK_NS = 20
# Classical limits, one megabit from 50 MHz, the fields' ends, the smallest bit that works.
TIMINGS = [
    BitTiming(2, 8, 8, 8, 4),
    BitTiming(2, 12, 7, 5, 4),
    BitTiming(1, 20, 19, 10, 8),
    BitTiming(5, 1, 4, 4, 3),
    BitTiming(1, 2, 3, 2, 1),
    BitTiming(1, 32, 32, 16, 16),
    BitTiming(256, 1, 4, 2, 1),
    BitTiming(1, 0, 1, 1, 1),
]


class TB:
    """Drives the bus level and the protocol's answers; follows the strobes with a clock of its own."""

    def __init__(self, dut: Any, timing: BitTiming) -> None:
        self.dut, self.timing = dut, timing
        self.cycle = 0
        self.level = 1
        self.tx, self.hard = 1, True

    async def start(self) -> None:
        dut = self.dut
        Clock(dut.clk_i, CLOCK_NS, unit="ns").start()
        dut.timing_i.value = self.timing.packed
        dut.rx_i.value, dut.tx_i.value, dut.hard_i.value, dut.enable_i.value = 1, 1, 1, 0
        dut.rst_i.value = 1
        await FallingEdge(dut.clk_i)
        await Timer(3 * CLOCK_NS, "ns")
        dut.rst_i.value = 0
        await Timer(CLOCK_NS, "ns")
        dut.enable_i.value = 1
        self.model = BitClock(self.timing, self.timing.brp)
        self.seen = 1  # at the last look
        self.sending = 1
        # The block's strobes come a clock after what decides them, and with them the answers to a sample.
        self.strobes = False, False
        self.bit = 1
        self.driven = 1

    async def clock(self, level: int) -> bool:
        """One clock with this level on the bus; compares strobes and level sent with the model; True at a sample."""
        dut, model = self.dut, self.model
        if level != self.level:
            dut.rx_i.value = self.level = level
        await Timer(CLOCK_NS // 4, "ns")
        assert int(dut.tx_o.value) == self.driven, f"clock {self.cycle}: sends {1 - self.driven}"
        got = bool(dut.sample_o.value), bool(dut.start_o.value)
        assert got == self.strobes, f"clock {self.cycle}: sample, start {got}, not {self.strobes}: {vars(model)}"
        assert not got[0] or int(dut.bit_o.value) == self.bit
        if got[1]:
            self.driven = self.sending
        assert int(dut.tx_next_o.value) == self.driven
        # The quantum that the next rising edge ends: an edge of the bus lies in its middle.
        end = self.cycle + 1
        sample = start = False
        if end % self.timing.brp == 0:
            first = end - model.begin == self.timing.brp
            if self.seen and not level:
                start = model.edge(end - self.timing.brp / 2, self.sending == 0)
            self.seen = level
            if start:
                model.ended(self.hard)
                # In the synchronisation segment there is nothing to restart.
                start = not first
            elif end == model.sample_at and model.before_sample:
                model.sampled(level)
                sample = True
            elif end == model.end_at:
                model.ended(self.hard)
                start = True
        self.strobes, self.bit = (sample, start), level
        if start:
            self.sending = self.tx
        await Timer(CLOCK_NS - CLOCK_NS // 4, "ns")
        # What was answered to a sample a clock before.
        dut.tx_i.value, dut.hard_i.value = self.tx, self.hard
        self.cycle = end
        return sample

    def answer(self, tx: int, hard: bool) -> None:
        """What the protocol decides at a sample."""
        self.tx, self.hard = tx, hard


@cocotb.test
@cocotb.parametrize(index=range(len(TIMINGS)))
async def strobes_follow_random_edges(dut: Any, index: int) -> None:
    """Edges anywhere, some a bit apart and some glitches; any answer of the protocol at each sample.

    Verifies: CAN-01, CAN-02, CAN-03
    """
    rng = random.Random(random.randrange(1 << 32))
    timing = TIMINGS[index]
    tb = TB(dut, timing)
    await tb.start()
    samples = 0
    change = timing.bit_cycles
    bits = max(12, min(300, 4000 // timing.bit_cycles))
    while samples < bits:
        level = tb.level
        if tb.cycle >= change:
            level ^= 1
            near = rng.choice([1, 1, 1, 2, 3]) * timing.bit_cycles + rng.randint(-2, 2) * timing.brp
            change = tb.cycle + max(1, rng.choice([near, near, near, rng.randint(1, 2 * timing.bit_cycles), 1]))
        if await tb.clock(level):
            samples += 1
            tb.answer(rng.choice([0, 1, 1]), rng.random() < 0.2)


def test_fl_can_bit_timing() -> None:
    """Time quanta, sample point, hard synchronisation and resynchronisation."""
    run_block_test("fl_can_bit_timing", ["can/fl_can_pkg.sv", "can/fl_can_bit_timing.sv"], __name__)
