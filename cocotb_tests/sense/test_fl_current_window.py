# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Mean of the phase currents over a window: which samples, what mean, which instant, how late; against exact fractions.

The bench is the converter: strobes at chosen clocks, each answered after a delay of its own, some never.
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from math import floor
from typing import Any

import cocotb
import pytest
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, ReadOnly

from fluxlock.cosim.block import run_block_test

CLOCK_NS = 20
MASK32 = 0xFFFF_FFFF
START_TO_WINDOW, MEAN_LATENCY, SINGLE_LATENCY = 1, 8, 1
FULL = 1 << 17


def mean(values: Sequence[int]) -> int:
    """Exact mean, rounded half up."""
    return floor(Fraction(sum(values), len(values)) + Fraction(1, 2))


@dataclass
class Sample:
    """A sample set: clock of its strobe, clock at which it arrives (None: lost), currents."""

    strobe: int
    arrival: int | None
    currents: tuple[int, ...]


@dataclass
class Seen:
    """What the block said in a run, clocks counted from the run's begin."""

    instants: list[int] = field(default_factory=list)
    outputs: list[tuple[int, tuple[int, ...], int, int]] = field(default_factory=list)  # clock, currents, time, count


@dataclass(frozen=True)
class Window:
    """Settings, clocks."""

    start: int
    start_to_first: int
    length: int

    @property
    def first(self) -> int:
        return self.start + START_TO_WINDOW + self.start_to_first


class TB:
    """Starts, strobes and samples by clock number."""

    def __init__(self, dut: Any) -> None:
        self.dut = dut
        self.phases = len(dut.sample_i.value) // 18

    async def start(self, now: int = 0, delay: int = 0) -> None:
        dut = self.dut
        self.now, self.delay = now, delay
        for name in (
            "start_i",
            "strobe_i",
            "sample_valid_i",
            "sample_i",
            "sample_time_i",
            "cfg_from_i",
            "cfg_length_i",
        ):
            getattr(dut, name).value = 0
        dut.now_i.value = now
        dut.cfg_delay_i.value = delay
        Clock(dut.clk_i, CLOCK_NS, unit="ns").start()
        dut.rst_i.value = 1
        for _ in range(3):
            await FallingEdge(dut.clk_i)
        dut.rst_i.value = 0

    def stamp(self, clock: int) -> int:
        """Stamp of a clock of the next run, as the sensing block makes it."""
        return (self.now + clock - self.delay) & MASK32

    async def run(self, cycles: int, windows: Sequence[Window], samples: Sequence[Sample]) -> Seen:
        """Settings change at a window's start; one run is one stretch of time."""
        dut, seen = self.dut, Seen()
        starts = {w.start: w for w in windows}
        strobes = {s.strobe for s in samples}
        arrivals = {s.arrival: s for s in samples if s.arrival is not None}
        assert len(arrivals) == sum(s.arrival is not None for s in samples), "two samples at once"
        for clock in range(cycles):
            dut.now_i.value = (self.now + clock) & MASK32
            dut.start_i.value = clock in starts
            if clock in starts:
                dut.cfg_from_i.value = starts[clock].start_to_first
                dut.cfg_length_i.value = starts[clock].length
            dut.strobe_i.value = clock in strobes
            sample = arrivals.get(clock)
            dut.sample_valid_i.value = sample is not None
            if sample is not None:
                dut.sample_i.value = sum((v & 0x3FFFF) << (18 * x) for x, v in enumerate(sample.currents))
                dut.sample_time_i.value = self.stamp(sample.strobe)
            await ReadOnly()
            if int(dut.instant_o.value):
                seen.instants.append(clock)
            if int(dut.valid_o.value):
                word = int(dut.current_o.value)
                values = [(word >> (18 * x)) & 0x3FFFF for x in range(self.phases)]
                currents = tuple(v - (1 << 18) if v >> 17 else v for v in values)
                seen.outputs.append((clock, currents, int(dut.time_o.value), int(dut.samples_o.value)))
            await FallingEdge(dut.clk_i)
        self.now = (self.now + cycles) & MASK32
        dut.start_i.value = dut.strobe_i.value = dut.sample_valid_i.value = 0
        return seen

    def expected(self, windows: Sequence[Window], samples: Sequence[Sample]) -> Seen:
        """Definition: the samples whose strobe lies in the window; only whole windows of which nothing was lost."""
        out = Seen()
        for k, w in enumerate(windows):
            cut = windows[k + 1].first if k + 1 < len(windows) else 1 << 40
            if w.length == 0:
                one = next((s for s in samples if w.first <= s.strobe < cut), None)
                if one is not None:
                    out.instants.append(one.strobe)
                    if one.arrival is not None:
                        clock = one.arrival + SINGLE_LATENCY
                        out.outputs.append((clock, one.currents, self.stamp(one.strobe), 1))
                continue
            middle = w.first + w.length // 2
            if middle < cut:
                out.instants.append(middle)
            inside = [s for s in samples if w.first <= s.strobe < w.first + w.length]
            if w.first + w.length > cut or not inside:
                continue
            arrivals = [s.arrival for s in inside if s.arrival is not None]
            if len(arrivals) < len(inside):
                continue
            clock = max(arrivals[-1], w.first + w.length - 1) + MEAN_LATENCY
            currents = tuple(mean([s.currents[x] for s in inside]) for x in range(self.phases))
            out.outputs.append((clock, currents, self.stamp(middle), len(inside)))
        return out

    async def verify(self, cycles: int, windows: Sequence[Window], samples: Sequence[Sample]) -> Seen:
        expected = self.expected(windows, samples)
        seen = await self.run(cycles, windows, samples)
        assert seen.instants == expected.instants, f"instants {seen.instants}, expected {expected.instants}"
        for got, want in zip(seen.outputs, expected.outputs, strict=False):
            assert got == want, f"clock, currents, time, count {got}, expected {want}"
        assert len(seen.outputs) == len(expected.outputs)
        return seen


def grid(
    rng: random.Random,
    phases: int,
    cycles: int,
    spacing: int,
    conversion: int = 24,
    lost: float = 0.0,
    size: int = FULL,
) -> list[Sample]:
    """Samples every `spacing` clocks with random currents; strobes are answered in their order."""
    return [
        Sample(
            clock,
            None if rng.random() < lost else clock + conversion,
            tuple(rng.randrange(-size, size) for _ in range(phases)),
        )
        for clock in range(rng.randrange(spacing), cycles - conversion - 20, spacing)
    ]


@cocotb.test()
async def random_windows(dut: Any) -> None:
    """Random positions, lengths and sample spacings, across the wrap of the stamps."""
    seed = cocotb.RANDOM_SEED
    dut._log.info("seed %d", seed)
    rng = random.Random(seed)
    tb = TB(dut)
    await tb.start(now=MASK32 - 3000, delay=51)
    outputs = 0
    for _ in range(12):
        period = rng.randrange(120, 700)
        cycles = 8 * period
        spacing = rng.randrange(16, 40)
        windows = [
            Window(start, rng.randrange(period // 2), rng.choice([0, 1, 1 + rng.randrange(period // 2 - 12)]))
            for start in range(5, cycles - 2 * period, period)
        ]
        samples = grid(rng, tb.phases, cycles, spacing, rng.randrange(14, 60))
        outputs += len((await tb.verify(cycles, windows, samples)).outputs)
    assert outputs > 15, f"{outputs} outputs only"


@cocotb.test()
async def windows_that_touch_and_reach_over(dut: Any) -> None:
    """A window as long as the carrier: every sample is in exactly one mean; also shifted into the next carrier."""
    rng = random.Random(3)
    tb = TB(dut)
    await tb.start(delay=20)
    for shift in (0, 37, 150, 299):
        for spacing in (16, 17, 25):
            cycles = 3000
            windows = [Window(s, shift, 300) for s in range(3, cycles - 700, 300)]
            seen = await tb.verify(cycles, windows, grid(rng, tb.phases, cycles, spacing))
            assert len(seen.outputs) == len(windows)


@cocotb.test()
async def every_count_is_divided_exactly(dut: Any) -> None:
    """1 to 255 samples at the ends of the range: the mean is exact, half up; more are left out."""
    rng = random.Random(4)
    tb = TB(dut)
    await tb.start()
    extremes = (FULL - 1, -FULL, 0, 1, -1)
    for n in [*range(1, 34), 63, 64, 65, 127, 128, 129, 254, 255]:
        length = (n - 1) * 16 + 1
        cycles = 5 + length + 120
        kind = rng.randrange(3)
        currents = [
            tuple(
                extremes[x % 2] if kind == 0 else rng.choice(extremes) if kind == 1 else rng.randrange(-FULL, FULL)
                for x in range(tb.phases)
            )
            for _ in range(n)
        ]
        samples = [Sample(4 + 16 * k, 4 + 16 * k + 30, c) for k, c in enumerate(currents)]
        seen = await tb.verify(cycles, [Window(3, 0, length)], samples)
        # The rule for the length puts the instant into the middle of first and last sample.
        assert seen.instants == [4 + 8 * (n - 1)] and seen.outputs[0][3] == n
    n = 260
    samples = [Sample(4 + 16 * k, 4 + 16 * k + 30, (k,) * tb.phases) for k in range(n)]
    seen = await tb.run(16 * n + 100, [Window(3, 0, 16 * n)], samples)
    assert [o[3] for o in seen.outputs] == [255] and seen.outputs[0][1] == (mean(range(255)),) * tb.phases


@cocotb.test()
async def one_sample(dut: Any) -> None:
    """Length 0: the first strobe from the window's clock on, its own stamp, one clock after it arrives."""
    rng = random.Random(5)
    tb = TB(dut)
    await tb.start(delay=7)
    for begin in range(24):
        windows = [Window(10 + begin + 200 * k, 40, 0) for k in range(4)]
        samples = grid(rng, tb.phases, 1000, 16 + begin % 5, lost=0.2)
        await tb.verify(1000, windows, samples)


@cocotb.test()
async def lost_samples_spoil_their_window_only(dut: Any) -> None:
    rng = random.Random(6)
    tb = TB(dut)
    await tb.start(delay=11)
    outputs = windows_seen = 0
    for length in (80, 200):
        for _ in range(4):
            cycles = 4000
            windows = [Window(s, 0, length) for s in range(3, cycles - 500, 200)]
            seen = await tb.verify(cycles, windows, grid(rng, tb.phases, cycles, 20, lost=0.05))
            outputs += len(seen.outputs)
            windows_seen += len(windows)
    assert 0.3 * windows_seen < outputs < 0.9 * windows_seen


@cocotb.test()
async def cut_and_empty_windows_give_nothing(dut: Any) -> None:
    rng = random.Random(8)
    tb = TB(dut)
    await tb.start()
    windows = [Window(s, 10, n) for s, n in ((5, 150), (105, 90), (205, 101), (305, 100), (405, 50))]
    seen = await tb.verify(700, windows, grid(rng, tb.phases, 700, 16))
    assert len(seen.outputs) == 3
    windows = [Window(5 + 100 * k, 3, 10) for k in range(5)]
    seen = await tb.verify(700, windows, [Sample(40 + 100 * k, 70 + 100 * k, (5,) * tb.phases) for k in range(5)])
    assert not seen.outputs and len(seen.instants) == 5
    # A start before the window begins moves it.
    seen = await tb.run(400, [Window(5, 60, 20), Window(45, 60, 20)], grid(rng, tb.phases, 400, 16))
    assert seen.instants == [45 + 1 + 60 + 10] and len(seen.outputs) == 1


@cocotb.test()
async def reset_forgets(dut: Any) -> None:
    tb = TB(dut)
    await tb.start()
    sample = Sample(10, 40, (1000,) * tb.phases)
    await tb.run(30, [Window(5, 0, 20)], [sample])
    dut.rst_i.value = 1
    await FallingEdge(dut.clk_i)
    dut.rst_i.value = 0
    tb.now = (tb.now + 1) & MASK32
    seen = await tb.run(60, [], [Sample(-20, 10, (1000,) * tb.phases)])
    assert not seen.outputs and not seen.instants
    await tb.verify(200, [Window(5, 0, 40)], [Sample(20, 50, (77,) * tb.phases), Sample(40, 70, (-78,) * tb.phases)])


@pytest.mark.parametrize("phases", [3, 5])
def test_fl_current_window(phases: int) -> None:
    """Current window alone.

    Verifies: WIN-01, WIN-02, WIN-03, WIN-04
    """
    sources = ["sense/fl_current_window.sv"]
    run_block_test("fl_current_window", sources, __name__, parameters={"Phases": phases})


if __name__ == "__main__":
    pytest.main([__file__])
