# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Currents at the legs' edges ahead against a model of whole intervals."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import cocotb
import pytest

from cocotb_tests.injection.bench import Bench
from cocotb_tests.injection.models import FULL_SCALE, clip, pack, unpack
from fluxlock.cosim.block import run_block_test

KNOWN_PHASES = 64
RISING, FALLING = 0, 1
NONE = -(1 << 17)  # an excursion that is not known


@dataclass
class Interval:
    """Between two updates, clocks from the first one: edges (clock, kind, leg), samples, the step."""

    length: int
    edges: list[tuple[int, int, int]]
    samples: list[tuple[int, list[int]]]
    step: tuple[int, list[int], int] | None  # clock, currents, phase


@dataclass
class Model:
    """Excursions of before and the next ones by phase, kind and leg; the step whose voltage acts."""

    phases: int
    excursion: dict[tuple[int, int, int], int] = field(default_factory=dict)
    following: dict[tuple[int, int, int], int] = field(default_factory=dict)
    acting: tuple[list[int], int] | None = None

    def ahead(self, current: Sequence[int], phase: int) -> list[int]:
        """Rising edges of all legs, then falling ones."""
        return [
            clip(current[leg] + self.following.get((phase, kind, leg), 0), 18)
            for kind in (RISING, FALLING)
            for leg in range(self.phases)
        ]

    def learn(self, interval: Interval) -> None:
        """What the samples of an interval tell; then its step becomes the one that acts."""
        free = 0
        for clock, values in interval.samples:
            after = {(kind, leg) for at, kind, leg in interval.edges if at < clock}
            if clock < free or not after:
                continue
            interval.edges = [e for e in interval.edges if (e[1], e[2]) not in after or e[0] >= clock]
            if self.acting is None:
                continue
            free = clock + 2 * self.phases + 1
            for kind, leg in after:
                written = clock + 1 + kind * self.phases + leg
                if self.acting[1] < KNOWN_PHASES and written <= interval.length:
                    place = (self.acting[1], kind, leg)
                    new = clip(values[leg] - self.acting[0][leg], 18)
                    before = self.excursion.get(place, NONE)
                    self.following[place] = new if before == NONE else clip(2 * new - before, 18)
                    self.excursion[place] = new
        self.acting = None if interval.step is None else interval.step[1:]


class TB(Bench):
    def __init__(self, dut: Any) -> None:
        super().__init__(dut)
        self.phases = len(dut.req_h_i.value)
        self.latency = 2 * self.phases + 3
        self.model = Model(self.phases)
        self.requests = [0] * self.phases

    async def start(self) -> None:
        inputs = ("update_i", "req_h_i", "sample_valid_i", "sample_i", "start_i", "current_i", "phase_i")
        await self.reset("enable_i", *inputs)
        await self.forget()

    async def forget(self) -> None:
        self.dut.enable_i.value = 0
        await self.clocks(64 * 2 * 8)
        self.dut.enable_i.value = 1
        self.model = Model(self.phases)

    def ahead(self) -> list[int]:
        return unpack(int(self.dut.ahead_o.value), 18, 2 * self.phases)

    async def interval(self, interval: Interval) -> list[int] | None:
        """Ahead of the step; ends with the clock of the next update."""
        dut = self.dut
        changes: dict[int, dict[str, int]] = {}

        def pulse(clock: int, name: str, **values: int) -> None:
            changes.setdefault(clock, {}).update({name: 1, **values})
            changes.setdefault(clock + 1, {}).setdefault(name, 0)

        for clock, kind, leg in sorted(interval.edges):
            self.requests[leg] = int(kind == RISING)
            changes.setdefault(clock, {})["req_h_i"] = sum(r << x for x, r in enumerate(self.requests))
        for clock, values in interval.samples:
            pulse(clock, "sample_valid_i", sample_i=pack(values, 18))
        got = None
        if interval.step is not None:
            clock, current, phase = interval.step
            pulse(clock, "start_i", current_i=pack(current, 18), phase_i=phase)
            changes.setdefault(clock + self.latency, {})
        pulse(interval.length, "update_i")
        now = 0
        for clock in sorted(c for c in changes if c <= interval.length):
            await self.clocks(clock - now)
            now = clock
            if interval.step is not None and clock == interval.step[0] + self.latency:
                assert int(dut.valid_o.value), f"no output after {self.latency} clocks"
                got = self.ahead()
            for name, value in changes[clock].items():
                getattr(dut, name).value = value
        await self.clocks(1)
        dut.update_i.value = 0
        self.model.learn(interval)
        return got


def draw(rng: random.Random, phases: int) -> list[int]:
    size = rng.choice([FULL_SCALE, 20_000, 300])
    return [rng.randrange(-size, size) for _ in range(phases)]


def draw_interval(rng: random.Random, tb: TB, phase: int) -> Interval:
    """Some legs have both edges in one order or one edge or none; samples far apart or close."""
    length = rng.randrange(6 * tb.phases + 20, 400)
    edges = []
    for leg in range(tb.phases):
        first = FALLING if tb.requests[leg] else RISING
        clocks = sorted(rng.sample(range(1, length), rng.choice([0, 1, 1, 2, 2])))
        edges += [(clock, first ^ (n & 1), leg) for n, clock in enumerate(clocks)]
    samples, clock = [], rng.randrange(2, 40)
    while clock < length:
        samples.append((clock, draw(rng, tb.phases)))
        clock += rng.choice([rng.randrange(1, 2 * tb.phases + 3), rng.randrange(20, 80)])
    step = (rng.randrange(1, length - tb.latency), draw(rng, tb.phases), phase)
    return Interval(length, edges, samples, step if rng.random() < 0.95 else None)


@cocotb.test()
async def follows_the_model(dut: Any) -> None:
    """Random edges, samples and steps over waves of any period; steps that are left out; a new wave knows nothing.

    Verifies: FOC-13
    """
    seed = cocotb.RANDOM_SEED
    dut._log.info("seed %d", seed)
    rng = random.Random(seed)
    tb = TB(dut)
    await tb.start()
    moved = 0
    for period in (2, 4, 5, 16, 40, 70):
        await tb.forget()
        for n in range(max(40, 5 * period // 2)):
            interval = draw_interval(rng, tb, n % period)
            wanted = tb.model.ahead(*interval.step[1:]) if interval.step else None
            got = await tb.interval(interval)
            assert got == wanted, f"period {period}, interval {n}: {got} instead of {wanted}"
            if wanted is not None and interval.step is not None:
                moved += sum(a != b for a, b in zip(wanted, interval.step[1] * 2, strict=True))
    assert moved > 500, f"only {moved} currents moved"


async def repeat(tb: TB, slope: int, right_from: int) -> None:
    """Excursions that repeat with the wave and grow with every period, on top of a current that stays."""
    rng = random.Random(5)
    period = 8
    at_first = [[[x // 8 for x in draw(rng, tb.phases)] for _ in range(2)] for _ in range(period)]
    base = [rng.randrange(-20_000, 20_000) for _ in range(tb.phases)]
    sampled = [rng.randrange(-20_000, 20_000) for _ in range(period)]

    def excursion(n: int, kind: int) -> list[int]:
        return [x + slope * (n // period) * (leg - 1) for leg, x in enumerate(at_first[n % period][kind])]

    await tb.forget()
    for n in range(5 * period):
        # The voltage of interval n has the phase n, and was computed from the sample of interval n - 1.
        acting = (n - 1) % period
        edges = [(60 + leg, RISING, leg) for leg in range(tb.phases)]
        edges += [(160 + leg, FALLING, leg) for leg in range(tb.phases)]
        samples = [
            (at, [b + sampled[acting] + x for b, x in zip(base, excursion(n, kind), strict=True)])
            for at, kind in ((80, RISING), (180, FALLING))
        ]
        current = [b + sampled[n % period] for b in base]
        got = await tb.interval(Interval(250, edges, samples, (10, current, (n + 1) % period)))
        if n >= right_from * period:
            wanted = [c + x for kind in range(2) for c, x in zip(current, excursion(n + 1, kind), strict=True)]
            assert got == wanted, f"interval {n}: {got} instead of {wanted}"


@cocotb.test()
async def repeating_current_is_foreseen(dut: Any) -> None:
    """Excursions that repeat are right from the second period on, those that change evenly from the third.

    Verifies: FOC-13
    """
    tb = TB(dut)
    await tb.start()
    await repeat(tb, 0, right_from=1)
    await repeat(tb, 150, right_from=2)


@cocotb.test()
async def disabled_is_the_sample(dut: Any) -> None:
    """Without the wave the currents are those of the step, and nothing is learned.

    Verifies: FOC-13
    """
    rng = random.Random(6)
    tb = TB(dut)
    await tb.start()
    dut.enable_i.value = 0
    for n in range(20):
        interval = draw_interval(rng, tb, n % 2)
        if interval.step is not None:
            assert await tb.interval(interval) == interval.step[1] * 2
    dut.enable_i.value = 1
    tb.model = Model(tb.phases)
    await tb.interval(Interval(60, [], [], (5, draw(rng, tb.phases), 0)))
    interval = Interval(60, [], [], (5, draw(rng, tb.phases), 1))
    assert await tb.interval(interval) == interval.step[1] * 2 if interval.step else False


@pytest.mark.parametrize("phases", [3, 5])
def test_fl_edge_current(phases: int) -> None:
    """Currents at the edges ahead."""
    run_block_test("fl_edge_current", ["foc/fl_edge_current.sv"], __name__, parameters={"Phases": phases})
