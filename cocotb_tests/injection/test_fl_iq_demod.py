# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""I/Q demodulation: sums bit by bit, periods and their ends, amplitude and phase of a tone."""

from __future__ import annotations

import cmath
import math
import random
from typing import Any

import cocotb

from cocotb_tests.injection.bench import Bench
from cocotb_tests.injection.models import BENCHES, FULL_SCALE, SOURCES, IqBits, Pair, pack, unpack
from fluxlock.cosim.block import run_block_test

BUSY_CLOCKS = 8


class TB(Bench):
    async def start(self) -> None:
        ports = ("start_i", "clear_i", "current_i", "phase_i", "cosine_i", "sine_value_i", "sine_i")
        await self.reset(*ports, period_i=4)

    async def sample(
        self, current: Pair, phase: int, cosine: int = 0, sine: int = 0, gap: int = 0
    ) -> tuple[list[int], int] | None:
        """One sample; the sums (d_re, d_im, q_re, q_im) and count of the period that it ends."""
        dut = self.dut
        dut.current_i.value = pack(current, 18)
        dut.phase_i.value = phase
        dut.start_i.value = 1
        await self.clocks(1)
        dut.start_i.value = 0
        dut.current_i.value, dut.phase_i.value = pack((0x15555, 0x15555), 18), 0xFFF
        dut.cosine_i.value, dut.sine_value_i.value = cosine & 0x3FFFF, sine & 0x3FFFF
        result = (unpack(int(dut.sum_o.value), 32, 4), int(dut.count_o.value)) if int(dut.valid_o.value) else None
        await self.clocks(5)
        dut.cosine_i.value, dut.sine_value_i.value = 0x15555, 0x15555
        await self.clocks(BUSY_CLOCKS - 6)
        assert int(dut.busy_o.value) == 1 and int(dut.valid_o.value) == 0
        await self.clocks(1)
        assert int(dut.busy_o.value) == 0, f"busy after {BUSY_CLOCKS} clocks"
        await self.clocks(gap)
        return result


def draw(rng: random.Random) -> int:
    return rng.choice([-FULL_SCALE, FULL_SCALE - 1, rng.randrange(-FULL_SCALE, FULL_SCALE), rng.randrange(-99, 99)])


@cocotb.test()
async def sums_are_exact(dut: Any) -> None:
    """Both references, any period, one or several samples an update, gaps in the phase, clear in the middle.

    Verifies: INJ-07
    """
    rng = random.Random(random.randrange(1 << 32))
    tb = TB(dut)
    await tb.start()
    results = 0
    for _ in range(40):
        model = IqBits(rng.choice([2, 3, 4, 5, 8, 40, 41]), sine=rng.randrange(2))
        dut.period_i.value, dut.sine_i.value = model.period, model.sine
        await tb.clear()
        phase, copies = rng.randrange(model.period), rng.randrange(1, 4)
        for n in range(4 * copies * model.period + rng.randrange(5)):
            args = ((draw(rng), draw(rng)), phase, draw(rng), draw(rng))
            got = await tb.sample(*args, gap=rng.choice([0, 0, 3]))
            expected = model.step(*args)
            assert got == expected, f"sample {n}: {got} instead of {expected}: {model}"
            results += got is not None
            if n % copies == copies - 1:
                phase = (phase + 1) % model.period
    assert results >= 80, f"only {results} periods"


@cocotb.test()
async def tone_gives_its_phasor(dut: Any) -> None:
    """Tones of any phase beside a constant current, over odd and even periods; a constant alone gives nothing.

    Verifies: INJ-07
    """
    tb = TB(dut)
    await tb.start()
    dut.sine_i.value = 1
    for period in (3, 4, 7, 40):
        dut.period_i.value = period
        await tb.clear()
        amplitude, phi, constant = 30_000, 0.7 * period, (-50_000, 90_000)
        got = None
        for m in range(3 * period + 1):
            angle = 2 * math.pi * (m / period + 0.01)
            tones = (amplitude * math.cos(angle + phi), amplitude / 50 * math.cos(angle - 1))
            d, q = (round(t + c) for t, c in zip(tones, constant, strict=True))
            cosine, sine = (round((FULL_SCALE - 1) * f(angle)) for f in (math.cos, math.sin))
            got = await tb.sample((d, q), m % period, cosine, sine) or got
        assert got is not None and got[1] == period
        d_re, d_im, q_re, q_im = (x * 2 / (4 * period) for x in got[0])
        for value, expected in (
            (complex(d_re, d_im), cmath.rect(amplitude, phi)),
            (complex(q_re, q_im), cmath.rect(amplitude / 50, -1)),
        ):
            assert abs(value - expected) < 3.0, f"period {period}: {value}, not {expected}"
    for period in (4, 8, 40):
        dut.period_i.value, dut.sine_i.value = period, 0
        await tb.clear()
        found = [await tb.sample((-FULL_SCALE, FULL_SCALE - 1), m % period) for m in range(3 * period + 1)]
        assert [f for f in found if f] == [([0, 0, 0, 0], period)] * 2, f"{found}"


def extreme_sums(count: int) -> list[int]:
    """Sums of `count` samples of the largest products."""
    products = (FULL_SCALE**2, -FULL_SCALE * (FULL_SCALE - 1), -FULL_SCALE * (FULL_SCALE - 1), (FULL_SCALE - 1) ** 2)
    signs = (1, -1, 1, -1)
    return [sign * count * ((x + (1 << 14)) >> 15) for sign, x in zip(signs, products, strict=True)]


@cocotb.test()
async def overflow_gives_no_result(dut: Any) -> None:
    """4095 samples of full scale fit, one more gives overflow and no result; the next period is right again.

    Verifies: INJ-07
    """
    tb = TB(dut)
    await tb.start()
    dut.sine_i.value = 1
    dut.period_i.value = 4
    await tb.clear()
    for count, fits in ((4095, True), (4096, False), (5, True)):
        await tb.sample((0, 0), 0)
        await tb.clear()
        for phase in (3, 0):
            await tb.sample((-FULL_SCALE, FULL_SCALE - 1), phase, -FULL_SCALE, FULL_SCALE - 1)
        for _ in range(count - 1):
            assert await tb.sample((-FULL_SCALE, FULL_SCALE - 1), 1, -FULL_SCALE, FULL_SCALE - 1) is None
        assert int(dut.overflow_o.value) == 0
        # The first sample of a period ends the one before.
        got = await tb.sample((0, 0), 0)
        assert int(dut.overflow_o.value) == (not fits)
        if fits:
            assert got == (extreme_sums(count), count)
        else:
            assert got is None
            assert await tb.sample((4, 4), 1) is None
            assert await tb.sample((4, 4), 0) == ([0, 0, 0, 0], 2)
            assert int(dut.overflow_o.value) == 1


@cocotb.test()
async def samples_too_close_are_counted(dut: Any) -> None:
    """A start while busy changes nothing but the count.

    Verifies: INJ-10
    """
    tb = TB(dut)
    await tb.start()
    for after in range(1, BUSY_CLOCKS + 1):
        await tb.clear()
        for n, phase in enumerate((3, 0, 1, 2, 3, 0)):
            if n != 2:
                got = await tb.sample((1000, -2000), phase)
                continue
            dut.current_i.value, dut.phase_i.value = pack((1000, -2000), 18), phase
            dut.start_i.value = 1
            await tb.clocks(1)
            dut.start_i.value = 0
            await tb.clocks(after - 1)
            dut.start_i.value, dut.phase_i.value, dut.current_i.value = 1, 0, 0
            await tb.clocks(1)
            dut.start_i.value = 0
            await tb.clocks(BUSY_CLOCKS - after)
        assert got == ([0, 0, 0, 0], 4)
        assert int(dut.overrun_o.value) == after


def test_fl_iq_demod() -> None:
    """I/Q demodulation with its multiplier."""
    run_block_test(
        "fl_iq_demod_bench", [*SOURCES, "injection/fl_iq_demod.sv", BENCHES / "fl_iq_demod_bench.sv"], __name__
    )
