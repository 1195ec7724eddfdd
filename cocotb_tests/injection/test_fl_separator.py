# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Filterless separation: exact amplitudes, fundamental samples, ramps, lost samples."""

from __future__ import annotations

import random
from typing import Any

import cocotb

from cocotb_tests.injection.bench import Bench
from cocotb_tests.injection.models import FULL_SCALE, Pair, pack, unpack
from fluxlock.cosim.block import run_block_test


class TB(Bench):
    async def start(self) -> None:
        await self.reset("valid_i", "clear_i", "current_i", "phase_i")

    async def sample(self, current: Pair, phase: int) -> tuple[list[int], list[int], int] | None:
        """One sample; hf, amplitude and peak if it brings new ones. Checks the fundamental."""
        dut = self.dut
        before = unpack(int(dut.fundamental_o.value), 18, 2)
        dut.current_i.value, dut.phase_i.value, dut.valid_i.value = pack(current, 18), phase, 1
        await self.clocks(1)
        dut.valid_i.value = 0
        fundamental = unpack(int(dut.fundamental_o.value), 18, 2)
        assert int(dut.fundamental_valid_o.value) == (phase % 2 == 0)
        assert fundamental == (before if phase % 2 else list(current))
        if not int(dut.valid_o.value):
            return None
        return unpack(int(dut.hf_o.value), 20, 2), unpack(int(dut.amplitude_o.value), 20, 2), int(dut.peak_o.value)


def draw(rng: random.Random) -> int:
    return rng.choice([-FULL_SCALE, FULL_SCALE - 1, rng.randrange(-FULL_SCALE, FULL_SCALE), rng.randrange(-99, 99)])


@cocotb.test()
async def separation_is_exact(dut: Any) -> None:
    """Random samples up to full scale, some lost, some forgotten; a sample in every clock and with pauses.

    Verifies: INJ-08
    """
    rng = random.Random(random.randrange(1 << 32))
    tb = TB(dut)
    await tb.start()
    phase, results = 0, 0
    history: list[tuple[int, Pair]] = []
    for n in range(4000):
        if rng.random() < 0.02:
            await tb.clear()
            history.clear()
        if rng.random() < 0.1:
            await tb.clocks(rng.randrange(1, 4))
        phase = (phase + (1 if rng.random() < 0.95 else rng.randrange(4))) % 4
        current = (draw(rng), draw(rng))
        if history and phase != (history[-1][0] + 1) % 4:
            history.clear()
        history = [*history, (phase, current)][-3:]
        got = await tb.sample(current, phase)
        expected = None
        if phase % 2 == 0 and len(history) == 3:
            (_, before), (peak, top), (_, after) = history
            hf = [2 * t - b - a for t, b, a in zip(top, before, after, strict=True)]
            expected = (hf, [-x for x in hf] if peak == 3 else hf, int(peak == 3))
            results += 1
        assert got == expected, f"sample {n}, phase {phase}: {got} instead of {expected}"
    assert results > 1000, f"only {results} results"


@cocotb.test()
async def hf_current_is_told_from_the_fundamental(dut: Any) -> None:
    """A triangle of the HF current upon ramps that change at zero crossings: its amplitude, the ramp's own samples.

    Verifies: INJ-08
    """
    tb = TB(dut)
    await tb.start()
    triangle = (0, 1, 0, -1)
    ramp, base = [0, 0], [5000, -8000]
    for n in range(400):
        phase = n % 4
        if phase == 0:
            ramp = [900 if base[0] < 0 else -450, 300 if base[1] < 0 else -700]
        current = (base[0] + 12_000 * triangle[phase], base[1] - 700 * triangle[phase])
        got = await tb.sample(current, phase)
        if n >= 2 and phase % 2 == 0:
            assert got is not None and got[1] == [24_000, -1400], f"sample {n}: {got}"
            assert unpack(int(dut.fundamental_o.value), 18, 2) == base
        base = [b + r for b, r in zip(base, ramp, strict=True)]
        assert max(map(abs, base)) < 100_000, "the ramps leave the range"


def test_fl_separator() -> None:
    """Filterless separation."""
    run_block_test("fl_separator", ["injection/fl_injection_pkg.sv", "injection/fl_separator.sv"], __name__)
