# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Angle accumulator against an exact sum, clock by clock."""

from __future__ import annotations

import random
from typing import Any

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, Timer

from fluxlock.cosim.block import run_block_test

CLOCK_NS = 20
MASK32 = (1 << 32) - 1
MASK36 = (1 << 36) - 1
PULSES = ("update_i", "omega_we_i", "correct_we_i", "strobe_i", "carrier_update_i")


class TB:
    """Drives the ports and keeps what the contract says beside them."""

    def __init__(self, dut: Any) -> None:
        self.dut = dut
        self.theta = self.omega = self.omega_next = self.correction = self.sample = self.carrier = 0

    async def start(self) -> None:
        Clock(self.dut.clk_i, CLOCK_NS, unit="ns").start()
        for name in (*PULSES, "omega_i", "correct_i"):
            getattr(self.dut, name).value = 0
        self.dut.rst_i.value = 1
        await FallingEdge(self.dut.clk_i)
        await Timer(3 * CLOCK_NS, "ns")
        self.dut.rst_i.value = 0

    async def clock(self, omega: int = 0, correct: int = 0, pulses: tuple[str, ...] = ()) -> None:
        """One clock with these inputs, then compare every output."""
        dut = self.dut
        for name in PULSES:
            getattr(dut, name).value = int(name in pulses)
        dut.omega_i.value = omega & MASK32
        dut.correct_i.value = correct & MASK32
        if "strobe_i" in pulses:
            self.sample = self.theta >> 4
        if "carrier_update_i" in pulses:
            self.carrier = self.theta >> 4
        self.theta += self.omega
        if "update_i" in pulses:
            self.theta += self.correction << 4
            self.omega, self.correction = self.omega_next, 0
        self.theta &= MASK36
        if "omega_we_i" in pulses:
            self.omega_next = omega
        if "correct_we_i" in pulses:
            self.correction = correct
        await Timer(CLOCK_NS, "ns")
        assert int(dut.theta_o.value) == self.theta >> 4
        assert int(dut.theta_sample_o.value) == self.sample
        assert int(dut.theta_update_o.value) == self.carrier
        assert dut.omega_o.value.to_signed() == self.omega


@cocotb.test()
async def angle_is_exact(dut: Any) -> None:
    """Random writes, updates and strobes, all coincidences: every output is that of the exact sum in every clock.

    Verifies: FOC-01
    """
    rng = random.Random(1)
    tb = TB(dut)
    await tb.start()
    extremes = [-(1 << 31), (1 << 31) - 1, -1, 0, 1]
    for _ in range(6000):
        omega = rng.choice([*extremes, rng.randrange(-(1 << 31), 1 << 31), rng.randrange(-2_000_000, 2_000_000)])
        correct = rng.choice([*extremes, rng.randrange(-(1 << 31), 1 << 31)])
        await tb.clock(omega, correct, tuple(name for name in PULSES if rng.random() < 0.2))


@cocotb.test()
async def speed_has_no_drift(dut: Any) -> None:
    """1500 Hz at 50 MHz over 30 000 clocks: 0.9 turns, off by no more than the speed's rounding allows, both ways.

    Verifies: FOC-01
    """
    tb = TB(dut)
    await tb.start()
    for hertz in (1500.0, -1500.0):
        omega = round(hertz / 50e6 * 2**36)
        await tb.clock(omega, 0, ("omega_we_i",))
        await tb.clock(0, 0, ("update_i",))
        begin = int(dut.theta_o.value)
        for _ in range(30_000):
            await tb.clock()
        turned = ((int(dut.theta_o.value) - begin) & MASK32) / 2**32
        expected = (hertz * 30_000 / 50e6) % 1.0
        assert abs(turned - expected) <= 30_000 * 0.5 / 2**36 + 1 / 2**32


@cocotb.test()
async def correction_acts_once(dut: Any) -> None:
    """A correction moves the angle at the next update only; written in the update's clock it waits for the one after.

    Verifies: FOC-01
    """
    tb = TB(dut)
    await tb.start()
    await tb.clock(0, 0x4000_0000, ("correct_we_i", "update_i"))
    for _ in range(5):
        await tb.clock()
    assert int(dut.theta_o.value) == 0
    for _ in range(3):
        await tb.clock(0, 0, ("update_i",))
        assert int(dut.theta_o.value) == 0x4000_0000


def test_fl_angle_nco() -> None:
    """Angle accumulator block test."""
    run_block_test("fl_angle_nco", ["foc/fl_angle_nco.sv"], __name__)
