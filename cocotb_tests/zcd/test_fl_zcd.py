# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Zero-crossing detection: against the true angle of a motor, and against its rules on random streams."""

from __future__ import annotations

import math
import random
from dataclasses import replace
from fractions import Fraction
from itertools import pairwise
from typing import Any

import cocotb

from cocotb_tests.zcd.six_step_motor import LSB, Motor
from cocotb_tests.zcd.zcd_bench import (
    DIRECT_LATENCY,
    FIRST,
    INTERPOLATED,
    INTERPOLATED_LATENCY,
    MASK32,
    TB,
    ZCD_SOURCES,
    Crossing,
    Sample,
    Settings,
    signed,
)
from fluxlock.cosim.block import run_block_test


def error_bound(motor: Motor, valid: list[int], visit: int) -> float:
    """Bound of the crossing time's error in clocks: noise over slope, curvature of the sine, rounding."""
    rad_per_clock = math.radians(60.0) / motor.sector_clocks
    true = motor.crossing(visit)
    near = sorted(valid, key=lambda t: abs(t - true))
    gap = (
        max(b - a for a, b in pairwise(valid) if a <= true + 1 and b >= true - 1)
        if (valid[0] <= true <= valid[-1])
        else abs(near[0] - true)
    )
    # With noise the bracket may be the one beside the true one, hence twice the gap.
    reach = min(2 * gap * rad_per_clock, math.radians(60.0))
    noise = motor.error_bound / (motor.amplitude * math.cos(reach) * rad_per_clock)
    return noise + 0.1 * reach**3 / math.cos(reach) / rad_per_clock + 1.5


async def run_motor(tb: TB, motor: Motor, settings: Settings, visits: int) -> list[float]:
    """Play whole visits, check each crossing, return the errors in degrees (positive = late)."""
    samples: dict[int, list[tuple[Sample, bool]]] = {}
    t = math.ceil(motor.visit_start(2))
    first = 2
    while motor.visit(t) < first + visits:
        s = motor.sample(t)
        samples.setdefault(motor.visit(t), []).append(s)
        t += motor.sample_period
    errors = []
    for visit, row in samples.items():
        count = len(tb.found)
        for played, _ in row:
            await tb.sample(played)
        new = tb.found[count:]
        # Samples that the physics allows to count.
        valid = [
            s.time
            for i, (s, clamped) in enumerate(row)
            if s.on
            and not clamped
            and s.age >= settings.settle
            and i >= settings.need_previous
            and all(not c and p.on and s.time - p.time <= s.age for p, c in row[i - settings.need_previous : i])
        ]
        true = motor.crossing(visit)
        assert len(new) <= 1, f"visit {visit}: {len(new)} crossings"
        if not valid:
            assert not new, f"visit {visit}: crossing without a valid sample"
            continue
        bound = error_bound(motor, valid, visit)
        if not new:
            assert valid[-1] < true + bound, f"visit {visit}: crossing at {true}, valid up to {valid[-1]}, none found"
            continue
        error = signed((new[0].time - round(true)) & MASK32, 32)
        assert new[0].sector == row[0][0].sector
        if new[0].late:
            assert new[0].time == valid[0] & MASK32 and valid[0] > true - bound, f"visit {visit}: late, {error} clocks"
            continue
        assert valid[0] < true + bound
        assert abs(error) <= bound, f"visit {visit}: off by {error} clocks, bound {bound:.1f}, {motor}"
        errors.append(error * 60.0 / motor.sector_clocks)
    return errors


@cocotb.test()
@cocotb.parametrize(seed=list(range(12)))
async def crossing_time_is_true(dut: Any, seed: int) -> None:
    """Random speed, duty, carrier, sampling, noise, both directions: every crossing within its bound.

    Verifies: ZCD-01, ZCD-02, ZCD-03, ZCD-06
    """
    rng = random.Random(seed)
    tb = TB(dut, gap=26)
    direction = 1 if seed % 2 == 0 else -1
    settings = Settings(reverse=int(direction < 0), need_previous=rng.choice([0, 1, 2]))
    await tb.start(settings)
    sector = math.exp(rng.uniform(math.log(3000), math.log(40000)))
    period = max(16, int(sector / rng.uniform(60, 160)))
    motor = Motor(
        sector_clocks=sector,
        amplitude=rng.uniform(8000, 60000),
        vdc=rng.uniform(100000, 125000),
        carrier=int(sector / rng.uniform(3.0, 8.0)),
        duty=rng.choice([1.0, rng.uniform(0.4, 0.95)]),
        sample_period=period,
        direction=direction,
        freewheel_deg=rng.uniform(0, 20),
        noise=rng.choice([0.0, LSB, 3 * LSB]),
        start=rng.choice([0, (1 << 32) - int(8 * sector)]),
        rng=rng,
    )
    errors = await run_motor(tb, motor, settings, 14)
    assert len(errors) >= 8, f"only {len(errors)} crossings were timed: {motor}"
    tb.check_counters()


@cocotb.test()
@cocotb.parametrize(direction=[1, -1])
async def interpolation_removes_the_gap(dut: Any, direction: int) -> None:
    """60 000 r/min, 20 kHz, duty 0.5, 1 LSB noise: bias and spread of the crossing below 0.15 degrees rms.

    Without interpolation the same samples are later by degrees.

    Verifies: ZCD-01
    """
    tb = TB(dut, gap=26)
    results = {}
    for method in (INTERPOLATED, FIRST):
        settings = Settings(reverse=int(direction < 0), method=method)
        motor = Motor(
            sector_clocks=50e6 / 6000 * 1.017,
            amplitude=1.5 * 6.28 / 30 * (1 << 17),
            vdc=25 / 30 * (1 << 17),
            carrier=2500,
            duty=0.5,
            sample_period=50,
            direction=direction,
            freewheel_deg=9,
            noise=1.7 * LSB,  # 1 LSB rms
            rng=random.Random(3),
        )
        if method == INTERPOLATED:
            await tb.start(settings)
            errors = await run_motor(tb, motor, settings, 40)
            assert len(errors) >= 35
        else:
            await tb.update(replace(settings, enable=0))
            await tb.update(settings)
            errors = []
            t = math.ceil(motor.visit_start(2))
            while motor.visit(t) < 42:
                crossing = await tb.sample(motor.sample(t)[0])
                if crossing:
                    assert crossing.time == t & MASK32
                    errors.append((t - motor.crossing(motor.visit(t))) * 60.0 / motor.sector_clocks)
                t += motor.sample_period
        results[method] = errors
    rms = math.sqrt(sum(e * e for e in results[INTERPOLATED]) / len(results[INTERPOLATED]))
    mean = {k: sum(v) / len(v) for k, v in results.items()}
    assert rms <= 0.15 and abs(mean[1]) <= 0.05, f"rms {rms:.3f}, mean {mean[1]:.3f} degrees"
    assert mean[0] > 1.0, f"first sample after the crossing is only {mean[0]:.2f} degrees late"


@cocotb.test()
@cocotb.parametrize(direction=[1, -1], need_previous=[1, 2])
async def clamped_samples_on_both_sides(dut: Any, direction: int, need_previous: int) -> None:
    """Freewheeling up to just before the crossing, clamping after every turn-on: no influence.

    Verifies: ZCD-02, ZCD-03
    """
    rng = random.Random(direction + need_previous)
    tb = TB(dut, gap=26)
    settings = Settings(reverse=int(direction < 0), need_previous=need_previous)
    await tb.start(settings)
    for freewheel in (22.0, 26.0):
        motor = Motor(
            sector_clocks=9000.0,
            amplitude=41000.0,
            vdc=109000.0,
            carrier=1250,
            duty=0.7,
            sample_period=50,
            direction=direction,
            freewheel_deg=freewheel,
            circulating=200,
            noise=LSB,
            rng=rng,
        )
        errors = await run_motor(tb, motor, settings, 16)
        assert len(errors) >= 10
        assert max(map(abs, errors)) < 0.3
    tb.check_counters()


@cocotb.test()
@cocotb.parametrize(direction=[1, -1])
async def overridden_crossing(dut: Any, direction: int) -> None:
    """Freewheel past the crossing: late, at the first valid sample, whose value gives the true crossing back.

    Verifies: ZCD-04
    """
    tb = TB(dut, gap=26)
    settings = Settings(reverse=int(direction < 0))
    await tb.start(settings)
    for freewheel in (33.0, 42.0, 48.0):
        motor = Motor(
            sector_clocks=9000.0,
            amplitude=41000.0,
            vdc=109000.0,
            carrier=1250,
            duty=0.8,
            sample_period=50,
            direction=direction,
            freewheel_deg=freewheel,
            rng=random.Random(7),
        )
        count = len(tb.found)
        assert await run_motor(tb, motor, settings, 12) == []
        late = tb.found[count:]
        assert len(late) >= 11 and all(c.late and c.before == 0 for c in late)
        rad_per_clock = math.radians(60.0) / motor.sector_clocks
        for visit, crossing in enumerate(late, 2):
            back = crossing.time - math.asin(abs(crossing.value) / motor.amplitude) / rad_per_clock
            error_deg = (back - motor.crossing(visit)) * 60.0 / motor.sector_clocks
            assert abs(error_deg) <= 0.15, f"freewheel {freewheel}: computed back with {error_deg:.3f} degrees"
    tb.check_counters()


def nominal(time: int, rel: int, sector: int = 1, **changes: Any) -> Sample:
    """A sample that counts, `rel` above vdc/2."""
    base = Sample(time, 50000 + rel, 100000, True, sector, 60000, 60000)
    return replace(base, **changes)


@cocotb.test()
@cocotb.parametrize(need_previous=[0, 1, 3, 4, 6, 15])
async def a_diode_lets_go(dut: Any, need_previous: int) -> None:
    """After a clamped sample so many are passed over, though each lies past the threshold as a filter's answer would.

    Verifies: ZCD-02
    """
    tb = TB(dut)
    await tb.start(Settings(need_previous=need_previous, method=FIRST))
    assert await tb.sample(nominal(0, 49000, comm_age=1000)) is None
    for k in range(1, need_previous + 1):
        assert await tb.sample(nominal(50 * k, 1000, comm_age=1000 + 50 * k)) is None, f"sample {k}"
    last = 50 * (need_previous + 1)
    got = await tb.sample(nominal(last, 1000, comm_age=1000 + last))
    assert got == Crossing(last, True, 1, 1000, 0)


@cocotb.test()
async def six_thresholds(dut: Any) -> None:
    """Each sector has its own threshold and direction; rel is exact; wrong slopes give no crossing.

    Verifies: ZCD-05, ZCD-06
    """
    rng = random.Random(11)
    tb = TB(dut)
    t = 0
    for reverse in (0, 1):
        thresholds = [rng.randrange(0x8000, 0x18000) for _ in range(6)]
        settings = Settings(threshold=thresholds, need_previous=0, reverse=reverse)
        if reverse:
            await tb.update(settings)
        else:
            await tb.start(settings)
        for sector in (0, 3, 1, 5, 2, 4):
            vdc = rng.randrange(90000, 131072)
            level = math.floor(Fraction(vdc * thresholds[sector], 1 << 17) + Fraction(1, 2))
            rising = (sector % 2 == 1) != bool(reverse)
            sign = 1 if rising else -1
            expected = Crossing((t + 300 + 40) & MASK32, False, sector, sign * 30, -sign * 20)
            rows = [(100, -20), (200, -1), (300, -20), (400, 30), (500, -30), (600, 50)]
            for dt, rel in rows:
                s = Sample(t + dt, level + sign * rel, vdc, True, sector, 60000, dt)
                assert await tb.sample(s) == (expected if dt == 400 else None), f"sector {sector}, dt {dt}"
            t += 1000
    # A visit that only shows the other slope: the first sample is past already, so late; no second crossing.
    await tb.update(Settings(need_previous=0, reverse=1))
    first = await tb.sample(nominal(t + 100, -50, sector=1, comm_age=100))
    assert first is not None and first.late
    assert await tb.sample(nominal(t + 200, 50, sector=1, comm_age=200)) is None


@cocotb.test()
async def exactly_at_the_threshold(dut: Any) -> None:
    """A sample at the threshold is past it: the crossing is at that sample.

    Verifies: ZCD-01
    """
    tb = TB(dut)
    await tb.start(Settings(need_previous=0))
    for sector, sign in ((1, 1), (2, -1)):
        t = 10_000 * sector
        assert await tb.sample(nominal(t, -7 * sign, sector, comm_age=10)) is None
        got = await tb.sample(nominal(t + 500, 0, sector, comm_age=510))
        assert got == Crossing(t + 500, False, sector, 0, -7 * sign)


@cocotb.test()
async def gap_limits(dut: Any) -> None:
    """Gaps up to 65535 clocks are interpolated, longer ones give the first sample after; stamps wrap.

    Verifies: ZCD-01, ZCD-07
    """
    tb = TB(dut)
    await tb.start(Settings(need_previous=0))
    t = (1 << 32) - 40_000
    for sector, gap, expected in ((1, 65535, 32768), (3, 65536, 65536), (5, 1 << 20, 1 << 20), (1, 16, 8)):
        sign = 1
        assert await tb.sample(nominal(t, -100 * sign, sector, comm_age=5)) is None
        got = await tb.sample(nominal(t + gap, 100 * sign, sector, comm_age=min(gap + 5, 65535)))
        assert got is not None and got.time == (t + expected) & MASK32 and not got.late, f"gap {gap}: {got}"
        t += gap + 1000


@cocotb.test()
async def same_sector_visited_again(dut: Any) -> None:
    """A commutation between two samples of one sector begins a new visit; also after a pause of the sampler.

    Verifies: ZCD-07
    """
    tb = TB(dut)
    await tb.start(Settings(need_previous=0))
    assert await tb.sample(nominal(0, -10, comm_age=3)) is None
    assert await tb.sample(nominal(100, 10, comm_age=103)) is not None
    assert await tb.sample(nominal(200, 20, comm_age=203)) is None
    again = await tb.sample(nominal(300, 20, comm_age=99))
    assert again is not None and again.late
    # The sampler pauses for longer than comm_age counts.
    assert await tb.sample(nominal(200_300, 20, comm_age=65535)) is None
    await tb.commutate()
    after = await tb.sample(nominal(400_300, 20, comm_age=65535))
    assert after is not None and after.late
    assert await tb.sample(nominal(600_300, 20, comm_age=65535)) is None


@cocotb.test()
async def latency_is_published(dut: Any) -> None:
    """Interpolated crossings come 23, direct and late ones 5 clocks after the sample, for every quotient.

    Verifies: ZCD-08
    """
    rng = random.Random(13)
    tb = TB(dut)
    await tb.start(Settings(need_previous=0))
    kinds = []
    for i in range(60):
        t, sector = 100_000 * i, i % 6
        sign = 1 if sector % 2 else -1
        late = rng.random() < 0.4
        if not late:
            await tb.sample(nominal(t, -sign * rng.randrange(1, 45000), sector, comm_age=9))
        gap = rng.randrange(16, 60000)
        await tb.sample(nominal(t + gap, sign * rng.randrange(45000), sector, comm_age=gap + 9))
        kinds.append(DIRECT_LATENCY if late else INTERPOLATED_LATENCY)
    assert tb.clocks_to_valid == kinds
    tb.check_counters()


@cocotb.test()
async def settings_are_shadowed(dut: Any) -> None:
    """Staged settings do nothing before the update; disabled: no crossing; enabling begins a visit.

    Verifies: ZCD-09
    """
    tb = TB(dut)
    await tb.start(Settings(need_previous=0))
    hostile = Settings(
        enable=0,
        method=FIRST,
        need_previous=3,
        settle=65535,
        blank=65535,
        margin=60000,
        threshold=(0x4000,) * 6,
        reverse=1,
    )
    tb.stage(hostile)
    await tb.sample(nominal(0, -10, comm_age=3))
    got = await tb.sample(nominal(100, 10, comm_age=103))
    assert got == Crossing(50, False, 1, 10, -10)
    await tb.update(hostile)
    for i, sector in enumerate((2, 3, 4)):
        for k, rel in enumerate((-30, 30, -30)):
            assert await tb.sample(nominal(1000 * (i + 1) + 100 * k, rel, sector, comm_age=100 * k)) is None
    await tb.update(Settings(need_previous=0))
    got = await tb.sample(nominal(5000, 10, sector=1, comm_age=5000))
    assert got is not None and got.late
    await tb.update(Settings(need_previous=0, enable=0))
    await tb.update(Settings(need_previous=0))
    got = await tb.sample(nominal(5100, 12, sector=1, comm_age=5100))
    assert got is not None and got.late
    tb.check_counters()


class Stream:
    """Random samples with a consistent hidden history of gate changes and commutations."""

    def __init__(self, seed: int) -> None:
        self.rng = random.Random(seed)
        self.time = self.rng.choice([1000, (1 << 32) - 5000])
        self.on = True
        self.sector = self.rng.randrange(6)
        self.last_gate = self.last_comm = self.time - self.rng.randrange(100)
        self.visit = 0
        self.walk = -200

    def next(self, settings: Settings) -> tuple[Sample, int, int, int]:
        """Next sample, its visit, the time of the last gate change, commutations since the last sample."""
        rng = self.rng
        step = rng.choice([50, 50, 50, 50, 50, rng.randrange(16, 400), rng.randrange(16, 400)])
        if rng.random() < 0.004:
            step = rng.choice([65535, 65536, 70000])
        comms = 0
        if rng.random() < 0.05:
            comms = rng.choice([1, 1, 1, 1, 1, 2, 6])
            self.last_comm = self.last_gate = self.time + 1 + rng.randrange(step)
            self.visit += 1
            self.sector = (self.sector + comms) % 6
            self.on = rng.random() < 0.8
            rising = (self.sector % 2 == 1) != bool(settings.reverse)
            self.walk = (-1 if rising else 1) * rng.randrange(-30, 250)
        elif rng.random() < 0.15:
            self.last_gate = self.time + 1 + rng.randrange(step)
            self.on = not self.on
        self.time += step
        rising = (self.sector % 2 == 1) != bool(settings.reverse)
        self.walk += (1 if rising else -1) * rng.randrange(-15, 35)
        vdc = 100000 + rng.randrange(-50, 50)
        value = vdc // 2 + self.walk * 10
        edge = settings.margin
        if rng.random() < 0.12:
            value = rng.choice([0, -300, edge - 1, edge, vdc - edge, vdc - edge + 1, vdc, vdc + 400])
        sample = Sample(
            self.time,
            value,
            vdc,
            self.on,
            self.sector,
            min(self.time - self.last_gate, 65535),
            min(self.time - self.last_comm, 65535),
        )
        return sample, self.visit, self.last_gate, comms


def reference(rows: list[tuple[Sample, int, int]], settings: Settings) -> list[Crossing | None]:
    """Crossings by the rules, each worked out from the whole history (sample, visit, last gate change)."""

    def unclamped(s: Sample) -> bool:
        return s.on and settings.margin <= s.value <= s.vdc - settings.margin

    def rel(s: Sample) -> int:
        return s.value - math.floor(Fraction(s.vdc * settings.threshold[s.sector], 1 << 17) + Fraction(1, 2))

    def counts(i: int) -> bool:
        s, visit, last_gate = rows[i]
        n = settings.need_previous
        return (
            unclamped(s)
            and s.age >= settings.settle
            and s.comm_age >= settings.blank
            and i >= n
            and all(unclamped(p) and v == visit and p.time >= last_gate for p, v, _ in rows[i - n : i])
            and all(rows[k + 1][0].time - rows[k][0].time < 65536 for k in range(i - n, i))
        )

    found: list[Crossing | None] = []
    before: dict[int, Sample] = {}
    done: set[int] = set()
    for i, (s, visit, _) in enumerate(rows):
        found.append(None)
        if visit in done or not counts(i):
            continue
        rising = (s.sector % 2 == 1) != bool(settings.reverse)
        if rel(s) * (1 if rising else -1) < 0:
            before[visit] = s
            continue
        done.add(visit)
        time = s.time
        b = before.get(visit)
        if b is not None and settings.method == INTERPOLATED and s.time - b.time < 65536:
            part = Fraction(abs(rel(b)), abs(rel(b)) + abs(rel(s)))
            time = b.time + math.floor((s.time - b.time) * part + Fraction(1, 2))
        found[-1] = Crossing(time & MASK32, b is None, s.sector, rel(s), 0 if b is None else rel(b))
    return found


@cocotb.test()
@cocotb.parametrize(seed=list(range(16)))
async def rules_on_random_streams(dut: Any, seed: int) -> None:
    """Every rule of what counts and what is a crossing, at its limits, over random settings and histories.

    Verifies: ZCD-01, ZCD-02, ZCD-03, ZCD-04, ZCD-05, ZCD-06, ZCD-07
    """
    rng = random.Random(100 + seed)
    settings = Settings(
        method=FIRST if seed % 4 == 3 else INTERPOLATED,
        need_previous=(0, 1, 2, 5)[seed % 4],
        settle=rng.choice([0, 30, 100]),
        blank=rng.choice([0, 60, 200]),
        margin=rng.choice([0, 4096, 20000]),
        threshold=tuple(0x10000 + rng.randrange(-200, 200) for _ in range(6)),
        reverse=rng.randrange(2),
    )
    tb = TB(dut, gap=26)
    await tb.start(settings)
    stream = Stream(seed)
    rows: list[tuple[Sample, int, int]] = []
    got: list[Crossing | None] = []
    for _ in range(2000):
        sample, visit, last_gate, comms = stream.next(settings)
        rows.append((sample, visit, last_gate))
        for _ in range(comms):
            await tb.commutate()
        got.append(await tb.sample(sample))
    expected = reference(rows, settings)
    for i, (g, e) in enumerate(zip(got, expected, strict=True)):
        assert g == e, f"sample {i}: {rows[i]}, before it {rows[max(0, i - 3) : i]}, {settings}"
    assert sum(e is not None for e in expected) > 20, "the stream has too few crossings"
    tb.check_counters()


def test_fl_zcd() -> None:
    """Zero-crossing detection block test."""
    run_block_test("fl_zcd", ZCD_SOURCES, __name__)
