# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Inputs and crossing times of the ZCD against a motor's true angle: third harmonic, averaging, computing back."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from typing import Any

import cocotb
from cocotb.triggers import FallingEdge, RisingEdge

from cocotb_tests.zcd.six_step_motor import LSB, Motor
from cocotb_tests.zcd.zcd_bench import (
    AVERAGED,
    BACK_LATENCY,
    FIRST,
    FLOATING,
    INTERPOLATED,
    MASK32,
    MEAN,
    STAR_POINT,
    TB,
    TERMINAL,
    ZCD_SOURCES,
    Crossing,
    Sample,
    Settings,
    signed,
)
from fluxlock.cosim.block import run_block_test

HIGH, LOW = (0, 0, 1, 1, 2, 2), (1, 2, 2, 0, 0, 1)  # legs that conduct in a sector
MEAN_LATENCY = 2  # published by the module


class Player:
    """Plays a motor in real time: a sample at its clock, now_i running, every crossing with the clock it came in."""

    def __init__(self, tb: TB, motor: Motor) -> None:
        self.tb, self.motor = tb, motor
        self.now = motor.start
        self.played: list[tuple[Sample, bool]] = []
        self.reported: list[tuple[Crossing, int]] = []  # with the time at which it was reported
        self.known_delay = 20  # clocks from a sample's time to sample_valid_i

    async def watch(self) -> None:
        dut = self.tb.dut
        while True:
            await RisingEdge(dut.zc_valid_o)
            await FallingEdge(dut.clk_i)
            self.reported.append((self.tb.read(), int(dut.now_i.value)))

    def channels(self, s: Sample) -> list[int]:
        """Terminals with the rails at the conducting legs; the star point as a channel of its own."""
        v = [0] * 9
        v[HIGH[s.sector]], v[LOW[s.sector]], v[FLOATING[s.sector]] = s.vdc, 0, s.value
        v[6] = s.vdc
        v[8] = self.motor.quantise(sum(v[:3]) / 3)
        return v

    async def clocks(self, n: int) -> None:
        """Time passes; now_i only matters to the clock where it ends a wait, so it moves in steps."""
        dut = self.tb.dut
        while n > 0:
            step = min(n, 8)
            dut.now_i.value = self.now & MASK32
            await self.tb.clocks(step)
            self.now += step
            n -= step

    async def play(self, visits: int, known: bool = True) -> None:
        dut, motor = self.tb.dut, self.motor
        dut.interval_i.value = round(motor.sector_clocks)
        dut.mean_i.value = 1000
        dut.known_i.value = int(known)
        t = math.ceil(motor.visit_start(2))
        last = motor.visit(t)
        self.now = t
        while motor.visit(t) < 2 + visits:
            s = motor.sample(t)
            if motor.visit(t) != last:
                last = motor.visit(t)
                await self.tb.commutate()
                self.now += 1
            await self.clocks(t + self.known_delay - self.now)
            self.played.append(s)
            dut.sample_i.value = sum((v & 0x3FFFF) << (18 * i) for i, v in enumerate(self.channels(s[0])))
            dut.sample_time_i.value = s[0].time & MASK32
            dut.sample_pwm_i.value = int(s[0].on) << 35 | s[0].sector << 32 | s[0].age << 16 | s[0].comm_age
            dut.sample_valid_i.value = 1
            await self.clocks(1)
            dut.sample_valid_i.value = 0
            t += motor.sample_period
        await self.tb.commutate()
        await self.clocks(400)

    def errors_deg(self) -> list[float]:
        """Errors of the reported times against the motor's true crossings, degrees, positive = late."""
        errors = []
        for crossing, reported in self.reported:
            visit = self.motor.visit(reported - self.known_delay - 8)
            candidates = [self.motor.crossing(v) for v in (visit - 1, visit, visit + 1)]
            error = min((signed((crossing.time - round(c)) & MASK32, 32) for c in candidates), key=abs)
            errors.append(error * 60.0 / self.motor.sector_clocks)
        return errors


def motor_1(direction: int, seed: int, **changes: Any) -> Motor:
    """60 000 r/min, 25 V, 12 bit with 1 LSB rms noise, a sample every microsecond."""
    values: dict[str, Any] = {
        "sector_clocks": 50e6 / 6000 * 1.017,
        "amplitude": 1.5 * 6.28 / 30 * (1 << 17),
        "vdc": 25 / 30 * (1 << 17),
        "carrier": 1250,
        "duty": 0.7,
        "sample_period": 50,
        "direction": direction,
        "freewheel_deg": 9,
        "noise": 1.7 * LSB,
        "rng": random.Random(seed),
    } | changes
    return Motor(**values)


async def run(dut: Any, motor: Motor, settings: Settings, visits: int = 30, known: bool = True) -> Player:
    tb = TB(dut)
    await tb.start(settings)
    player = Player(tb, motor)
    cocotb.start_soon(player.watch())
    await player.play(visits, known)
    tb.found = [c for c, _ in player.reported]
    tb.check_counters()
    return player


def rms(errors: list[float]) -> float:
    return math.sqrt(sum(e * e for e in errors) / len(errors))


def peak_of(motor: Motor, source: int) -> int:
    return round(motor.amplitude / (1 if source == TERMINAL else 3))


@cocotb.test()
@cocotb.parametrize(source=[STAR_POINT, MEAN], direction=[1, -1])
async def third_harmonic(dut: Any, source: int, direction: int) -> None:
    """The star point, measured or computed, gives the true crossings; its threshold moves as the terminal's does.

    Verifies: ZCD-10
    """
    motor = motor_1(direction, 1)
    settings = Settings(source=source, reverse=int(direction < 0), margin=6000)
    player = await run(dut, motor, settings)
    errors = player.errors_deg()
    dut._log.info(
        "mean %.3f, rms %.3f, max %.3f degrees", sum(errors) / len(errors), rms(errors), max(map(abs, errors))
    )
    assert len(errors) == 30 and not any(c.late for c, _ in player.reported)
    assert rms(errors) < (0.5 if source == STAR_POINT else 0.25) and abs(sum(errors) / len(errors)) < 0.15


@cocotb.test()
async def third_harmonic_is_exact(dut: Any) -> None:
    """Values of both third harmonics against exact integers, clamp test at its limits, with random thresholds.

    Verifies: ZCD-10
    """
    rng = random.Random(5)
    tb = TB(dut)
    await tb.start(Settings())
    kinds = set()
    for k in range(400):
        source = rng.choice([STAR_POINT, MEAN])
        threshold = rng.randrange(0x8000, 0x18000)
        margin = rng.choice([0, 3000, rng.randrange(12000)])
        await tb.update(Settings(enable=0))
        await tb.update(Settings(source=source, need_previous=0, threshold=(threshold,) * 6, margin=margin))
        vdc = rng.randrange(60000, 131072)
        limits = [-(-(vdc + 3 * margin) // 3), (2 * vdc - 3 * margin) // 3]  # the outermost that count
        star = rng.choice([limits[0] - 1, limits[0], limits[1], limits[1] + 1, rng.randrange(*limits)])
        spread = rng.choice([-1, 0, 1])
        terminals = [star + 7000, star - 9000, star + 2000 + spread]
        if max(terminals) > 131071:
            continue
        value = star if source == STAR_POINT else math.floor(sum(terminals) / 3 + 0.5)
        channels = [*terminals, 0, 0, 0, vdc, 0, star if source == STAR_POINT else 77]
        dut.sample_i.value = sum((v & 0x3FFFF) << (18 * i) for i, v in enumerate(channels))
        dut.sample_time_i.value = 1000 * k
        sector = rng.choice([1, 3, 5, 0, 2, 4])
        dut.sample_pwm_i.value = 1 << 35 | sector << 32 | 60000 << 16 | 60000
        dut.sample_valid_i.value = 1
        await tb.clocks(1)
        dut.sample_valid_i.value = 0
        dut.sample_i.value = 0
        await tb.clocks(4 + (MEAN_LATENCY if source == MEAN else 0))
        rel = value - math.floor(vdc * threshold / (1 << 17) + 0.5)
        counts = 3 * (value - margin) >= vdc and 3 * (value + margin) <= 2 * vdc
        # v_SM itself: the definition in the module's head.
        if counts != (abs(value - vdc / 2) <= vdc / 6 - margin):
            assert abs(abs(value - vdc / 2) - (vdc / 6 - margin)) < 1e-6
        past = rel >= 0 if sector % 2 else rel <= 0
        context = f"source {source}, value {value}, vdc {vdc}, margin {margin}, threshold {threshold}, sector {sector}"
        assert bool(int(dut.zc_valid_o.value)) == (counts and past), context
        if counts and past:
            assert tb.read() == Crossing(1000 * k, True, sector, rel, 0), context
        kinds.add((source, counts, past))
        await tb.clocks(3)
    assert len(kinds) == 8


@cocotb.test()
@cocotb.parametrize(source=[TERMINAL, MEAN], direction=[1, -1])
async def averaging_beats_interpolation(dut: Any, source: int, direction: int) -> None:
    """At 1 LSB noise the average of eight samples is at least twice as good as the line between two.

    Verifies: ZCD-12
    """
    got = {}
    for method in (INTERPOLATED, AVERAGED):
        motor = motor_1(direction, 2, duty=1.0, sector_clocks=50e6 / 2000 * 1.013, amplitude=1.5 * 2.1 / 30 * (1 << 17))
        settings = Settings(
            source=source, method=method, reverse=int(direction < 0), margin=6000, peak=peak_of(motor, source)
        )
        player = await run(dut, motor, settings, 20)
        errors = player.errors_deg()
        assert len(errors) == 20 and all(c.averaged == (method == AVERAGED) for c, _ in player.reported)
        got[method] = rms(errors)
        dut._log.info("method %d: rms %.3f, max %.3f degrees", method, got[method], max(map(abs, errors)))
    assert got[AVERAGED] < 0.5 * got[INTERPOLATED]


async def collect(tb: TB, found: list[Crossing]) -> None:
    """What every clock with a report says; sleeps in between."""
    while True:
        await RisingEdge(tb.dut.zc_valid_o)
        await FallingEdge(tb.dut.clk_i)
        while int(tb.dut.zc_valid_o.value):
            found.append(tb.read())
            await FallingEdge(tb.dut.clk_i)


FAR_CLOCKS, DISTANCE_MAX = 1 << 13, (1 << 15) - 1  # clocks, published by fl_crossing_time


def line_between_means(
    before: list[tuple[int, int]], after: list[tuple[int, int]], sign: int, distance: Callable[[int], float],
    good: Callable[[list[tuple[int, int]]], bool],
) -> tuple[float, int, float]:  # fmt: skip
    """Time of a crossing, samples used for its mean (0: interpolated), how far an error of all distances moves it.

    before, after: time and rel, from the crossing outwards, four at most. good: may these samples take part?
    """
    for n in (4, 2):
        if min(len(before), len(after)) < n:
            continue
        b, a = before[:n], after[:n]
        if not good(before[:2] + after[:2]) or not good(b + a):
            continue
        t_before, t_after = (sum(t for t, _ in part) / n for part in (b, a))
        d_before = sum(distance(rel) for _, rel in b) / n
        d_after = sum((1 if rel * sign >= 0 else -1) * distance(rel) for _, rel in a) / n
        if abs(n * d_after) < 4:  # as good as not positive: the chip may round it to either
            return math.nan, n, 0.0
        if d_after < 0:
            return t_after - d_after, 2 * n, 1.0
        span = t_after - t_before
        return t_before + span * d_before / (d_before + d_after), 2 * n, span / (d_before + d_after)
    (tb, rb), (ta, ra) = before[0], after[0]
    return tb + (ta - tb) * abs(rb) / (abs(ra) + abs(rb)), 0, 0.0


@cocotb.test()
@cocotb.parametrize(linear=[0, 1], scale=[0.8, 1.0, 1.25])
async def average_is_the_line_between_means(dut: Any, linear: int, scale: float) -> None:
    """Random samples around a crossing: what floating point gives for 8 or 4 of them, else the interpolated time.

    Samples lie up to some thousand clocks apart, noise puts some after the crossing on the other side of it, some
    saturate. `scale` makes the peak that the block is told wrong.

    Verifies: ZCD-12
    """
    seed = 77 + linear + round(8 * scale)
    dut._log.info("seed %d", seed)
    rng = random.Random(seed)
    tb = TB(dut)
    peak = round(scale * 40000)
    settings = Settings(method=AVERAGED, need_previous=0, peak=peak, linear=linear, wait_q8=255)
    await tb.start(settings)
    dut.known_i.value = 1
    dut.mean_i.value = 1
    seen, noisy = set(), 0
    reports: list[Crossing] = []
    cocotb.start_soon(collect(tb, reports))
    for visit in range(160):
        spread = 90 if visit % 2 else rng.choice([300, 1000, 3500, 6000])
        interval = rng.choice([9000, 9000, 90_000, 300_000]) if spread > 90 else 9000
        dut.interval_i.value = interval

        def distance(rel: int, interval: int = interval) -> float:
            x = abs(rel) / peak
            return interval * (x / 2 if linear else math.asin(min(x, 1.0)) / (math.pi / 3))

        sector = 1 + visit % 2
        sign = 1 if sector == 1 else -1
        base = 200_000 * (visit + 1)
        befores = [-rng.randrange(1, 14000) for _ in range(rng.randrange(1, 7))]
        afters = [rng.randrange(0, 14000)] + [rng.randrange(-600, 16000) for _ in range(rng.randrange(0, 6))]
        if rng.random() < 0.1:
            afters = [rng.randrange(0, 300)] + [rng.randrange(-900, 100) for _ in range(5)]
        if rng.random() < 0.15:
            afters[rng.randrange(len(afters))] = peak - 10 if not linear else peak + 10
        rows = []
        t = base
        for rel in befores + afters:
            t += rng.randrange(16, spread)
            rows.append((t, sign * rel))
        for t, rel in rows:
            dut.now_i.value = t & MASK32
            channels = [0] * 9
            channels[FLOATING[sector]], channels[6] = 65000 + rel, 130000
            dut.sample_i.value = sum((v & 0x3FFFF) << (18 * i) for i, v in enumerate(channels))
            dut.sample_time_i.value = t & MASK32
            dut.sample_pwm_i.value = 1 << 35 | sector << 32 | 60000 << 16 | min(t - base, 65535)
            dut.sample_valid_i.value = 1
            await tb.clocks(1)
            dut.sample_valid_i.value = 0
            await tb.clocks(280)
        await tb.commutate()
        await tb.clocks(40)
        (found,) = reports
        reports.clear()
        assert not found.late
        tb.found.append(found)
        after = rows[len(befores) :][:4]
        before = rows[: len(befores)][::-1][:4]
        (tb_, rb), (ta, ra) = before[0], after[0]
        interpolated = tb_ + math.floor((ta - tb_) * abs(rb) / (abs(ra) + abs(rb)) + 0.5)

        def good(part: list[tuple[int, int]], interpolated: int = interpolated) -> bool:
            return all(
                abs(rel) / peak < (1 if linear else 125 / 128)
                and abs(t - interpolated) < FAR_CLOCKS
                and distance(rel) < DISTANCE_MAX
                for t, rel in part
            )

        wanted, used, gain = line_between_means(before, after, sign, distance, good)
        if math.isnan(wanted):
            continue
        seen.add((used, min(len(before), len(after)) >= 2))
        noisy += gain == 1.0
        assert found.averaged == bool(used), f"{used} samples: {rows}"
        error = found.time - wanted
        # Every distance may be off by a clock and by the error of the arc sine.
        bound = 1.5 + gain * (1.0 + interval * 1.1e-3)
        assert abs(error) <= bound, f"off by {error} clocks of {bound} with {used} samples: {rows}"
    assert seen == {(0, False), (0, True), (4, True), (8, True)} and noisy
    tb.check_counters()


@cocotb.test()
@cocotb.parametrize((("source", "duty"), [(TERMINAL, 0.35), (MEAN, 0.7)]))
async def averaging_needs_no_exact_flux(dut: Any, source: int, duty: float) -> None:
    """The peak wrong by a fifth either way: the mean stays clearly better than the line between two samples.

    Verifies: ZCD-12
    """
    got = {}
    for method, factor in ((INTERPOLATED, 1.0), (AVERAGED, 0.8), (AVERAGED, 1.2)):
        motor = motor_1(1, 9, duty=duty, sector_clocks=50e6 / 6000 * 1.013, amplitude=1.5 * 4.2 / 30 * (1 << 17))
        peak = round(factor * peak_of(motor, source))
        settings = Settings(source=source, method=method, margin=6000, peak=peak, wait_q8=64)
        player = await run(dut, motor, settings, 24)
        errors = player.errors_deg()
        got[method, factor] = rms(errors)
        averaged = sum(c.averaged for c, _ in player.reported)
        dut._log.info("method %d, peak x %.1f: %d of 24 averaged, rms %.3f", method, factor, averaged, rms(errors))
        assert len(errors) == 24 and averaged == (24 if method == AVERAGED else 0)
    for factor in (0.8, 1.2):
        assert got[AVERAGED, factor] < 0.8 * got[INTERPOLATED, 1.0]


@cocotb.test()
@cocotb.parametrize(wait_q8=[0, 6, 32, 128])
async def averaging_waits_no_longer(dut: Any, wait_q8: int) -> None:
    """Chopped and fast: whatever is missing, the report comes by the wait limit (or the interpolation's own time).

    Verifies: ZCD-12
    """
    methods = set()
    for speed, period in ((1.0, 50), (4.0, 25), (0.3, 80)):
        motor = motor_1(1, 4, sector_clocks=8333.0 / speed, sample_period=period, duty=0.5, carrier=int(2500 / speed))
        settings = Settings(method=AVERAGED, peak=peak_of(motor, TERMINAL), wait_q8=wait_q8)
        player = await run(dut, motor, settings, 24)
        limit = wait_q8 / 256 * motor.sector_clocks
        for crossing, reported in player.reported:
            if crossing.late:
                continue
            after = next(s.time for s, _ in player.played if signed((s.time - crossing.time) & MASK32, 32) >= -period)
            known = [s.time for s, _ in player.played if s.on and s.time >= after]
            first = next((t for t in known if t >= crossing.time - 8), known[0])
            slack = 8 + 8  # now_i moves in steps of 8
            direct = first + player.known_delay + 23 + 8 * period + 4 * slack  # settling and need_previous
            latest = max(crossing.time + limit + slack, direct)
            assert reported <= latest, f"{reported - crossing.time} clocks after it, limit {limit:.0f}"
            methods.add(crossing.averaged)
        errors = [e for e, (c, _) in zip(player.errors_deg(), player.reported, strict=True) if not c.late]
        assert rms(errors) < 0.35, f"rms {rms(errors):.3f}"
    assert methods == ({False} if wait_q8 == 0 else {False, True} if wait_q8 < 128 else methods)


@cocotb.test()
@cocotb.parametrize(source=[TERMINAL, MEAN], direction=[1, -1], use_mean=[0, 1])
async def overridden_is_computed_back(dut: Any, source: int, direction: int, use_mean: int) -> None:
    """Freewheel to 31..50 degrees: late, computed back within 0.2 degrees rms of the truth; plain late when off.

    Verifies: ZCD-13
    """
    for freewheel in (33.0, 42.0, 50.0):
        motor = motor_1(direction, 3, duty=0.8, freewheel_deg=freewheel, noise=0.5 * LSB)
        settings = Settings(
            source=source,
            reverse=int(direction < 0),
            compute_back=1,
            use_mean=use_mean,
            peak=peak_of(motor, source),
            margin=3000,
        )
        tb = TB(dut)
        await tb.start(settings)
        player = Player(tb, motor)
        cocotb.start_soon(player.watch())
        dut.known_i.value = 1
        player_mean = round(motor.sector_clocks)
        play = cocotb.start_soon(player.play(12))
        await tb.clocks(1)
        dut.mean_i.value = player_mean
        dut.interval_i.value = 1 if use_mean else player_mean
        await play
        errors = player.errors_deg()
        assert len(errors) >= 10 and all(c.late and c.back for c, _ in player.reported)
        dut._log.info("freewheel %.0f: rms %.3f, max %.3f degrees", freewheel, rms(errors), max(map(abs, errors)))
        assert rms(errors) < 0.2 and max(map(abs, errors)) < 0.5


@cocotb.test()
@cocotb.parametrize(case=["off", "unknown", "no peak", "beyond"])
async def late_without_computing_back(dut: Any, case: str) -> None:
    """Off, without an interval, without a peak or with a sample beyond it: late at the sample's own time.

    Verifies: ZCD-13
    """
    motor = motor_1(1, 3, duty=0.8, freewheel_deg=40.0)
    peak = {"no peak": 0, "beyond": 3000}.get(case, peak_of(motor, TERMINAL))
    settings = Settings(compute_back=int(case != "off"), peak=peak)
    player = await run(dut, motor, settings, 8, known=case != "unknown")
    times = {s.time & MASK32 for s, _ in player.played}
    assert len(player.reported) >= 7
    assert all(c.late and not c.back and c.time in times for c, _ in player.reported)


@cocotb.test()
async def back_latency(dut: Any) -> None:
    """A crossing computed back comes a constant number of clocks after its sample.

    Verifies: ZCD-13, ZCD-08
    """
    tb = TB(dut)
    await tb.start(Settings(need_previous=0, compute_back=1, peak=30000, method=FIRST))
    dut.known_i.value = 1
    dut.interval_i.value = 6000
    for k in range(6):
        channels = [0] * 9
        sector = k
        channels[FLOATING[sector]], channels[6] = 50000 + (15000 if k % 2 else -15000), 100000
        dut.sample_i.value = sum((v & 0x3FFFF) << (18 * i) for i, v in enumerate(channels))
        dut.sample_time_i.value = 10000 * (k + 1)
        dut.sample_pwm_i.value = 1 << 35 | sector << 32 | 9000 << 16 | 9000
        dut.sample_valid_i.value = 1
        await tb.clocks(1)
        dut.sample_valid_i.value = 0
        await tb.clocks(BACK_LATENCY - 2)
        assert int(dut.zc_valid_o.value) == 0
        await tb.clocks(1)
        assert int(dut.zc_valid_o.value) == 1
        got = tb.read()
        assert got.back and got.late and abs(got.time - (10000 * (k + 1) - 3000)) <= 3
        await tb.clocks(20)


def test_fl_zcd_methods() -> None:
    """Inputs and crossing times of the detection."""
    run_block_test("fl_zcd", ZCD_SOURCES, __name__)
