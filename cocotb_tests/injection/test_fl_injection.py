# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Square-wave generator: patterns, mean, start and end, phase and angle of the samples."""

from __future__ import annotations

import random
from typing import Any

import cocotb
import pytest

from cocotb_tests.injection.bench import Bench
from cocotb_tests.injection.models import FULL_SCALE, TURN, pack, square, unpack
from fluxlock.cosim.block import run_block_test

SOURCES = ["injection/fl_injection_pkg.sv", "injection/fl_injection.sv"]


class TB(Bench):
    """Updates with `spacing` clocks between them; `double`: every second one is a carrier's middle."""

    def __init__(self, dut: Any) -> None:
        super().__init__(dut)
        self.axes = len(dut.voltage_o.value) // 18
        self.amplitude = [0] * self.axes
        self.double = 0
        self.second = 1
        self.spacing = 6

    async def start(self) -> None:
        ports = ("update_i", "second_i", "strobe_i", "enable_i", "first_i", "delay_i", "rate_i", "amplitude_i")
        await self.reset(*ports, period_i=2)

    def configure(self, period: int, first: int, delay: int = 0, rate: int = 0) -> None:
        dut = self.dut
        dut.period_i.value, dut.first_i.value, dut.delay_i.value, dut.rate_i.value = period, first, delay, rate
        dut.amplitude_i.value = pack(self.amplitude, 18)

    async def update(self) -> list[int]:
        """One update; the voltage of the step that begins with it, a clock later."""
        dut = self.dut
        self.second = 1 - self.second if self.double else 0
        dut.update_i.value, dut.second_i.value = 1, self.second
        await self.clocks(1)
        dut.update_i.value = 0
        voltage = self.voltage()
        await self.clocks(self.spacing - 1)
        assert self.voltage() == voltage, "the voltage moves between updates"
        return voltage

    def voltage(self) -> list[int]:
        return unpack(int(self.dut.voltage_o.value), 18, self.axes)

    async def strobe(self) -> tuple[int, int]:
        dut = self.dut
        dut.strobe_i.value = 1
        await self.clocks(1)
        dut.strobe_i.value = 0
        return int(dut.phase_sample_o.value), int(dut.angle_sample_o.value)


def times(sign: int, amplitude: int) -> int:
    return min(FULL_SCALE - 1, sign * amplitude)


@cocotb.test()
async def pattern_is_locked_to_the_updates(dut: Any) -> None:
    """Periods 2..9, 40, 4095 from any quarter: begun in a carrier's first half, one phase an update, mean 0.

    Verifies: INJ-01, INJ-02
    """
    rng = random.Random(1)
    tb = TB(dut)
    await tb.start()
    for period in (2, 3, 4, 5, 6, 7, 8, 9, 40, 4095):
        for first in sorted({0, period // 4, period // 2, period - 1}):
            tb.double = rng.randrange(2)
            tb.second = rng.randrange(2)
            tb.spacing = 2
            tb.amplitude = [
                rng.choice([-FULL_SCALE, FULL_SCALE - 1, rng.randrange(-5000, 5000)]) for _ in range(tb.axes)
            ]
            tb.configure(period, first)
            assert await tb.update() == [0] * tb.axes
            dut.enable_i.value = 1
            voltage = await tb.update()
            while tb.double and tb.second:
                assert int(dut.active_o.value) == 0 and voltage == [0] * tb.axes, "began in a carrier's second half"
                voltage = await tb.update()
            sums = [0] * tb.axes
            end = period + rng.randrange(period)
            for n in range(2 * period):
                phase = (first + n) % period
                expected = [times(square(phase, period), a) for a in tb.amplitude]
                context = f"period {period}, first {first}, update {n}"
                assert int(dut.active_o.value) == 1 and int(dut.phase_o.value) == phase, context
                assert voltage == expected, f"{voltage} instead of {expected}: {context}"
                zero = phase in (period // 4, period // 2 + period // 4)
                assert int(dut.zero_o.value) == zero, context
                sums = [a + b for a, b in zip(sums, voltage, strict=True)]
                if n == end:
                    dut.enable_i.value = 0
                voltage = await tb.update()
            if period < 100:
                assert all(abs(s) <= period * (-FULL_SCALE in tb.amplitude) for s in sums), f"mean not 0: {sums}"
            assert int(dut.active_o.value) == 0 and voltage == [0] * tb.axes, f"no end: period {period}"


@cocotb.test()
async def amplitude_waits_for_a_whole_period(dut: Any) -> None:
    """Amplitudes written at any update act from the first phase on; period and first only at a start.

    Verifies: INJ-02
    """
    tb = TB(dut)
    await tb.start()
    tb.double, tb.spacing = 1, 4
    tb.amplitude = [1000 + k for k in range(tb.axes)]
    tb.configure(4, 1)
    dut.enable_i.value = 1
    while int(dut.active_o.value) == 0:
        voltage = await tb.update()
    in_use = tb.amplitude
    for n in range(200):
        phase = (1 + n) % 4
        if phase == 1:
            in_use = tb.amplitude
        assert voltage == [square(phase, 4) * a for a in in_use], f"update {n}"
        tb.amplitude = [(37 * n + 11 * k) % 5000 - 2500 for k in range(tb.axes)]
        tb.configure(4 + n % 3, n % 4)
        voltage = await tb.update()


@cocotb.test()
async def samples_have_phase_and_angle(dut: Any) -> None:
    """Phase less the delay and angle since phase 0 began to act, at random strobes, for a rate of one turn a period.

    Verifies: INJ-03
    """
    rng = random.Random(2)
    tb = TB(dut)
    await tb.start()
    for period, first in ((4, 1), (40, 10), (7, 0)):
        tb.spacing = 50
        rate = round(TURN * 16 / (period * tb.spacing))
        delay = 0
        tb.configure(period, first, delay, rate)
        dut.enable_i.value = 1
        while int(dut.active_o.value) == 0:
            await tb.update()
        for n in range(5 * period):
            # Clocks of the update pulse, of the strobe and of the strobe's answer.
            delay = rng.randrange(period)
            dut.delay_i.value = delay
            wait = rng.randrange(tb.spacing - 2)
            dut.update_i.value, dut.second_i.value = 1, 0
            if wait == 0:
                phase, angle = await tb.strobe()
                dut.update_i.value = 0
                await tb.clocks(tb.spacing - 1)
                expected_phase = (first + n - delay) % period
            else:
                await tb.clocks(1)
                dut.update_i.value = 0
                await tb.clocks(wait - 1)
                phase, angle = await tb.strobe()
                await tb.clocks(tb.spacing - wait - 1)
                expected_phase = (first + n + 1 - delay) % period
            assert phase == expected_phase, f"strobe {wait} clocks after update {n + 1}, period {period}"
            # The phase that acts from this update on began to be computed at the one before.
            acting = first + n
            if acting >= period:
                # Zeroed in the clock of the update's pulse, to be seen in the next one.
                expected = (acting * tb.spacing + wait - 1) / (period * tb.spacing)
                error = (angle / TURN - expected + 0.5) % 1 - 0.5
                assert abs(error) < 1e-6, f"{angle / TURN} instead of {expected % 1}, {wait} clocks after the update"
        dut.enable_i.value = 0
        while int(dut.active_o.value) == 1:
            await tb.update()


@pytest.mark.parametrize("subspaces", [1, 2])
def test_fl_injection(subspaces: int) -> None:
    """Square-wave generator for one and two subspaces."""
    run_block_test("fl_injection", SOURCES, __name__, parameters={"Subspaces": subspaces})


def test_bad_settings_are_asserted(capfd: pytest.CaptureFixture[str]) -> None:
    """The assertion on period, first and delay is alive.

    Verifies: INJ-10
    """
    with pytest.raises(AssertionError):
        run_block_test("fl_injection", SOURCES, "cocotb_tests.injection.bad_settings", parameters={"Subspaces": 1})
    assert "period from 2, first and delay below it" in "".join(capfd.readouterr())
