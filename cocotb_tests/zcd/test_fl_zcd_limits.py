# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Limits of the ZCD: the wait to the clock, thresholds to the bit, intervals up to 24 bits, counters beyond 1000."""

from __future__ import annotations

import math
import random
from dataclasses import replace
from typing import Any

import cocotb

from cocotb_tests.zcd.zcd_bench import AVERAGED, FIRST, FLOATING, MASK32, TB, ZCD_SOURCES, Settings
from fluxlock.cosim.block import run_block_test

PEAK, LEVEL = 40000, 50000  # 2^17 = full scale
WAIT_LATENCY, FAR_CLOCKS = 24, 1 << 13  # clocks, published by fl_crossing_time
STEP = 40  # clocks between samples


async def feed(
    tb: TB, sector: int, time: int, rel: int, clocks: int, *, level: int = LEVEL, vdc: int = 2 * LEVEL,
    age: int = 60000, comm_age: int = 60000,
) -> None:  # fmt: skip
    """A sample that lies `rel` past `level` in the sector's direction, then `clocks` clocks."""
    dut = tb.dut
    channels = [0] * 9
    channels[FLOATING[sector]], channels[6] = level + (rel if sector % 2 else -rel), vdc
    dut.sample_i.value = sum((v & 0x3FFFF) << (18 * i) for i, v in enumerate(channels))
    dut.sample_time_i.value = time & MASK32
    dut.sample_pwm_i.value = 1 << 35 | sector << 32 | age << 16 | comm_age
    dut.sample_valid_i.value = 1
    await tb.clocks(1)
    dut.sample_valid_i.value = 0
    await tb.clocks(clocks - 1)


async def averaging(dut: Any) -> TB:
    """Set up to average, in a slow machine: the wait is never over by itself."""
    tb = TB(dut)
    await tb.start(Settings())
    dut.known_i.value = 1
    dut.interval_i.value = 40_000
    await tb.update(Settings(method=AVERAGED, need_previous=0, peak=PEAK, wait_q8=255))
    return tb


@cocotb.test()
async def wait_ends_at_its_clock(dut: Any) -> None:
    """With samples missing a crossing is reported floor(interval * wait / 2^8) after it, not a clock before.

    Verifies: ZCD-12
    """
    rng = random.Random(11)
    tb = TB(dut)
    await tb.start(Settings())
    dut.known_i.value = 1
    for visit in range(80):
        interval, wait = rng.randrange(1 << rng.randrange(9, 25)), rng.randrange(1, 256)
        limit = interval * wait >> 8
        if limit < 1:
            continue
        dut.interval_i.value = interval
        dut.mean_i.value = rng.randrange(1 << 24)
        await tb.update(Settings(method=AVERAGED, need_previous=0, peak=PEAK, wait_q8=wait))
        start = rng.randrange(1 << 32)
        sector = 1 + visit % 2
        # Steep enough for distances below 2^15 clocks.
        rel = min(10000, PEAK * 20000 // interval)
        for k in range(3):
            await feed(tb, sector, start + k * STEP, rel if k == 2 else -rel, 20)
        crossing = start + 3 * STEP // 2  # halfway between the last two
        for now in (limit - 1, -rng.randrange(1, 1 << 30), limit - 1):
            dut.now_i.value = (crossing + now) & MASK32
            for _ in range(60):
                await tb.clocks(1)
                assert not int(dut.zc_valid_o.value), f"interval {interval}, wait {wait}: at {now} clocks of {limit}"
        dut.now_i.value = (crossing + limit) & MASK32
        for clock in range(1, 6):
            await tb.clocks(1)
            assert bool(int(dut.zc_valid_o.value)) == (clock == 3), f"interval {interval}, wait {wait}: {clock} clocks"
            if clock == 3:
                got = tb.read()
                assert (got.time, got.late, got.averaged) == (crossing & MASK32, False, False)


@cocotb.test()
@cocotb.parametrize(use_mean=[0, 1], linear=[0, 1])
async def distance_over_intervals(dut: Any, use_mean: int, linear: int) -> None:
    """A crossing computed back from one sample lies where floating point puts it, for intervals up to 24 bits.

    Verifies: ZCD-13
    """
    rng = random.Random(23 + use_mean)
    tb = TB(dut)
    settings = Settings(need_previous=0, compute_back=1, method=FIRST, use_mean=use_mean, linear=linear)
    await tb.start(settings)
    dut.known_i.value = 1
    for visit in range(300):
        peak = rng.randrange(1000, 1 << 17)
        await tb.update(replace(settings, peak=peak))
        interval = rng.randrange(1 << rng.randrange(9, 25))
        dut.interval_i.value, dut.mean_i.value = (0x155555, interval) if use_mean else (interval, 0x155555)
        rel = rng.randrange(1, min(peak * 95 // 100, 60000))
        time = rng.randrange(1 << 32)
        await feed(tb, 1 + visit % 2, time, rel, 2, level=65000, vdc=130000)
        for _ in range(60):
            if int(dut.zc_valid_o.value):
                break
            await tb.clocks(1)
        got = tb.read()
        wanted = interval * (rel / peak / 2 if linear else math.asin(rel / peak) / (math.pi / 3))
        error = ((time - got.time) & MASK32) - wanted
        assert got.late and got.back, f"interval {interval}, rel {rel} of {peak}"
        assert abs(error) <= 1.0 + interval * (2e-5 if linear else 3.2e-4), (
            f"interval {interval}, rel {rel} of {peak}: {error} clocks off"
        )
        await tb.clocks(4)


@cocotb.test()
async def counters_count_on(dut: Any) -> None:
    """All counters over more than a thousand averaged crossings and as many that are computed back.

    Verifies: ZCD-12, ZCD-13
    """
    tb = TB(dut)
    settings = Settings(need_previous=0, compute_back=1, peak=PEAK, method=AVERAGED, wait_q8=255)
    await tb.start(settings)
    dut.known_i.value = 1
    dut.interval_i.value = 100000

    def counters() -> tuple[int, ...]:
        return tuple(int(port.value) for port in (dut.crossings_o, dut.late_o, dut.back_o, dut.averaged_o))

    for visit in range(1100):
        for k, rel in enumerate((-10000, -5000, 4000, 9000)):
            dut.now_i.value = (visit << 16) + k * STEP
            await feed(tb, 1 + visit % 2, (visit << 16) + k * STEP, rel, 150 if k == 3 else 30)
        if visit % 49 == 48:
            assert counters() == (visit + 1, 0, 0, visit + 1)
    await tb.update(Settings(need_previous=0, compute_back=1, peak=PEAK, method=FIRST))
    for visit in range(1300):
        await feed(tb, 1 + visit % 2, (visit << 16) + STEP, 9000, 40)
        if visit % 49 == 48:
            assert counters() == (1101 + visit, visit + 1, visit + 1, 1100)


@cocotb.test()
async def threshold_and_margin_are_exact(dut: Any) -> None:
    """At its threshold a sample is past it, one unit before it not; at its margin it counts, one unit beyond it not.

    Verifies: ZCD-02, ZCD-05, ZCD-06
    """
    rng = random.Random(31)
    tb = TB(dut)
    await tb.start(Settings())
    for visit in range(600):
        sector, vdc = 1 + visit % 2, rng.randrange(40000, 1 << 17)
        threshold = rng.randrange(0x8000, 0x18000)
        level = math.floor(vdc * threshold / (1 << 17) + 0.5)
        rel = rng.choice([-1, 0, 1, rng.randrange(200)])
        value = level + (rel if sector % 2 else -rel)
        outside = visit % 3  # 0: the margin is far off; else at it, on either side
        margin = [0, value, vdc - value][outside] + rng.choice([0, 1])
        if margin >= 1 << 17:
            continue
        await tb.update(Settings(need_previous=0, method=FIRST, threshold=(threshold,) * 6, margin=margin))
        before = int(dut.crossings_o.value)
        await feed(tb, sector, visit << 16, rel, 12, level=level, vdc=vdc)
        wanted = rel >= 0 and margin <= value <= vdc - margin
        found = (int(dut.crossings_o.value) - before) & 0xFFFF
        assert found == wanted, f"sector {sector}, vdc {vdc}, threshold {threshold}, margin {margin}, value {value}"


@cocotb.test()
async def ages_are_exact(dut: Any) -> None:
    """The sample before is of the same on-state, and of the same visit, if the age is the distance or more.

    Verifies: ZCD-02, ZCD-07
    """
    rng = random.Random(37)
    tb = TB(dut)
    await tb.start(Settings(need_previous=1, method=FIRST, settle=0))
    for visit in range(400):
        since, short = rng.randrange(20, 1 << rng.randrange(6, 16)), rng.choice([0, 1])
        sector, time = 1 + visit % 2, visit << 18
        before = int(dut.crossings_o.value)
        await feed(tb, sector, time, -5000, 12)
        await feed(tb, sector, time + since, 5000, 12, age=since - short)
        assert (int(dut.crossings_o.value) - before) & 0xFFFF == 1 - short, f"{since} clocks, age {since - short}"
    await tb.update(Settings(need_previous=0, method=FIRST, settle=0))
    for visit in range(400):
        since, short = rng.randrange(20, 1 << rng.randrange(6, 16)), rng.choice([0, 1])
        sector, time = 1 + visit % 2, visit << 18
        before = int(dut.crossings_o.value)
        await feed(tb, sector, time, 5000, 12)
        await feed(tb, sector, time + since, 5000, 12, comm_age=since - short)
        found = (int(dut.crossings_o.value) - before) & 0xFFFF
        assert found == 1 + short, f"{since} clocks, commutation {since - short} ago"


@cocotb.test()
async def one_bit_beside_the_threshold(dut: Any) -> None:
    """A sample with one bit unlike its threshold's, or none, is past it on the right side alone, whatever was rounded.

    Verifies: ZCD-02
    """
    rng = random.Random(41)
    tb = TB(dut)
    await tb.start(Settings())
    for visit in range(1200):
        sector, vdc, low = 1 + visit % 2, rng.randrange(100000, 1 << 17), visit % 16
        level = rng.randrange(1 << (16 - low)) << low | 1 << low  # its lowest bit that is set
        threshold = round(level * (1 << 17) / vdc)  # its product is rounded up or down
        assert level == math.floor(vdc * threshold / (1 << 17) + 0.5)
        value = level ^ rng.choice([0, 1 << rng.randrange(17)])
        rel = value - level if sector % 2 else level - value
        await tb.update(Settings(need_previous=0, method=FIRST, threshold=(threshold,) * 6, margin=0))
        before = int(dut.crossings_o.value)
        await feed(tb, sector, visit << 16, rel, 12, level=level, vdc=vdc)
        found = (int(dut.crossings_o.value) - before) & 0xFFFF
        assert found == (rel >= 0 and value <= vdc), f"sector {sector}, vdc {vdc}, threshold {threshold}, value {value}"


@cocotb.test()
async def commutation_ends_the_wait(dut: Any) -> None:
    """A commutation in the clocks of the interpolation is not forgotten: nothing waits for samples after it.

    Verifies: ZCD-12
    """
    tb = await averaging(dut)
    for visit in range(60):
        start, pulse = visit << 16, 1 + visit % 20
        for k in range(3):
            dut.now_i.value = start + k * STEP
            await feed(tb, 1 + visit % 2, start + k * STEP, 10000 if k == 2 else -10000, 5 if k == 2 else 20)
        valid = []
        for clock in range(1, 60):
            dut.comm_applied_i.value = int(clock == pulse)
            await tb.clocks(1)
            if int(dut.zc_valid_o.value):
                valid.append(clock)
        assert len(valid) == 1 and valid[0] <= 24, f"commutation {pulse} clocks after: reported after {valid}"
        got = tb.read()
        assert (got.time, got.averaged) == (start + 3 * STEP // 2, False)


@cocotb.test()
async def mean_follows_the_last_sample(dut: Any) -> None:
    """Samples are worked out as they come: where they are far apart one distance and a division follow the last.

    Verifies: ZCD-12
    """
    tb = await averaging(dut)
    for visit in range(20):
        start = visit << 16
        for k, rel in enumerate((-8000, -6000, -4000, -2000, 2000, 4000, 6000, 8000)):
            dut.now_i.value = start + k * 100
            await feed(tb, 1 + visit % 2, start + k * 100, rel, 6 if k == 7 else 100)
            assert not int(dut.zc_valid_o.value)
        clocks = 0
        while not int(dut.zc_valid_o.value):
            await tb.clocks(1)
            clocks += 1
            assert clocks <= 50, "no report 56 clocks after the last sample"
        got = tb.read()
        assert got.averaged and abs(got.time - (start + 350)) <= 1


@cocotb.test()
async def mean_follows_the_wait(dut: Any) -> None:
    """The eighth sample missing: the mean of two and two is there WAIT_LATENCY clocks after the wait at most.

    Verifies: ZCD-12
    """
    rng = random.Random(43)
    tb = TB(dut)
    await tb.start(Settings())
    dut.known_i.value = 1
    clocks_taken = set()
    for visit in range(60):
        interval, wait = rng.randrange(4000, 100_000), rng.randrange(60, 256)
        limit = interval * wait >> 8
        dut.interval_i.value = interval
        await tb.update(Settings(method=AVERAGED, need_previous=0, peak=PEAK, wait_q8=wait))
        start = rng.randrange(1 << 32)
        dut.now_i.value = start
        # The last one comes so late that it is being worked on when the wait ends, now and then.
        work = rng.choice([rng.randrange(1, 60), 200])
        for k, rel in enumerate((-8000, -6000, -4000, -2000, 2000, 4000, 6000)):
            await feed(tb, 1 + visit % 2, start + k * STEP, rel, work if k == 6 else 120)
            assert not int(dut.zc_valid_o.value)
        dut.now_i.value = (start + 7 * STEP // 2 + limit) & MASK32
        clocks = 0
        while not int(dut.zc_valid_o.value):
            await tb.clocks(1)
            clocks += 1
            assert clocks <= WAIT_LATENCY, f"interval {interval}, wait {wait}, {work} clocks after the last sample"
        clocks_taken.add(clocks)
        got = tb.read()
        assert got.averaged
        assert abs(((got.time - start + 50) & MASK32) - 50 - 7 * STEP // 2) <= 1
        await tb.clocks(10)
    assert max(clocks_taken) == WAIT_LATENCY and len(clocks_taken) > 1


@cocotb.test()
@cocotb.parametrize(rising=[0, 1], after=[0, 1])
async def far_samples_take_no_part(dut: Any, rising: int, after: int) -> None:
    """The second sample FAR_CLOCKS from the interpolated crossing: interpolated. One clock nearer: averaged.

    Verifies: ZCD-12
    """
    tb = await averaging(dut)
    dut.interval_i.value = 100_000
    for visit in range(40):
        sector, start, beyond = 2 * (visit % 2) + rising, (visit + 1) << 17, visit // 2 % 2
        far = FAR_CLOCKS - 1 + beyond
        times = [-STEP, STEP] if after else [-far, -STEP, STEP, 2 * STEP]
        times = [-2 * STEP, *times, far] if after else times
        for t in times:
            dut.now_i.value = start + t
            await feed(tb, sector, start + t, t, 90)
        await tb.commutate()
        for _ in range(60):
            if int(dut.zc_valid_o.value):
                break
            await tb.clocks(1)
        got = tb.read()
        assert abs(got.time - start) <= 2
        tb.found.append(got)
        assert got.averaged == (not beyond), f"sample {far} clocks off"
    tb.check_counters()


def test_fl_zcd_limits() -> None:
    """Numbers of the detection at their limits."""
    run_block_test("fl_zcd", ZCD_SOURCES, __name__)
