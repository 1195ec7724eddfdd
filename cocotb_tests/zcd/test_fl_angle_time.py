# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Time from sample to crossing: against the arc sine in floating point, to the published error bound."""

from __future__ import annotations

import math
import random
from pathlib import Path
from typing import Any

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, Timer

from fluxlock.cosim.block import run_block_test
from fluxlock.generate import tables

CLOCK_NS = 20
LATENCY, SATURATED_LATENCY = 25, 6  # clocks, published by the module
LIMIT = 125 / 128  # of the sine's argument
BOUND, BOUND_AT_LIMIT = 3.2e-4, 1.1e-3  # of the interval, published by the module


async def start(dut: Any) -> None:
    dut.rst_i.value = 1
    dut.start_i.value = 0
    Clock(dut.clk_i, CLOCK_NS, unit="ns").start()
    await FallingEdge(dut.clk_i)
    await Timer(3 * CLOCK_NS, "ns")
    dut.rst_i.value = 0
    await Timer(CLOCK_NS, "ns")


async def measure(dut: Any, value: int, peak: int, interval: int, linear: int) -> tuple[int, bool]:
    """Distance and saturation flag; checks the latency."""
    dut.value_i.value, dut.peak_i.value, dut.interval_i.value, dut.linear_i.value = value, peak, interval, linear
    dut.start_i.value = 1
    await Timer(CLOCK_NS, "ns")
    dut.start_i.value = 0
    dut.value_i.value, dut.peak_i.value, dut.interval_i.value, dut.linear_i.value = 1, 2, 3, 1 - linear
    latency = SATURATED_LATENCY if value >= peak else LATENCY
    for _ in range(latency - 1):
        assert int(dut.valid_o.value) == 0
        await Timer(CLOCK_NS, "ns")
    assert int(dut.valid_o.value) == 1, f"not valid after {latency} clocks"
    return int(dut.distance_o.value), bool(int(dut.saturated_o.value))


@cocotb.test()
@cocotb.parametrize(seed=list(range(3)))
async def distance_is_within_the_bound(dut: Any, seed: int) -> None:
    """Random samples, peaks and intervals: sine to the bound, straight flank to a clock, saturation beyond.

    Verifies: ZCD-11
    """
    rng = random.Random(seed)
    await start(dut)
    worst = 0.0
    for i in range(4000):
        peak = rng.choice([rng.randrange(1, 1 << 17), rng.randrange(2000, 1 << 17), (1 << 17) - 1])
        value = rng.choice(
            [0, peak - 1, peak, rng.randrange(peak + 1), rng.randrange(peak + 1), rng.randrange(1 << 17)]
        )
        interval = rng.choice([1, (1 << 24) - 1, rng.randrange(1 << 24), rng.randrange(400, 100_000)])
        linear = int(i % 4 == 0)
        got, saturated = await measure(dut, value, peak, interval, linear)
        x = value / peak
        context = f"value {value}, peak {peak}, interval {interval}, linear {linear}"
        if linear:
            assert saturated == (value >= peak), context
            exact = interval * min(x, 1.0) / 2
            assert abs(got - exact) <= 1 + interval * 2e-5, f"{got} instead of {exact}: {context}"
            continue
        exact = interval * math.asin(min(x, LIMIT)) / (math.pi / 3)
        if abs(x - LIMIT) > 4e-5:
            assert saturated == (x > LIMIT), context
        bound = BOUND if x <= 0.95 else BOUND_AT_LIMIT
        assert abs(got - exact) <= 1 + interval * bound, f"{got} instead of {exact}: {context}"
        if x <= 0.95 and interval > 100_000:
            worst = max(worst, abs(got - exact) / interval)
    dut._log.info("worst error up to 0.95: %.2e of the interval = %.4f degrees", worst, 60 * worst)
    assert worst > 0.3 * BOUND, "the bound is far from what happens"


@cocotb.test()
async def grows_with_the_value(dut: Any) -> None:
    """Never falls from one value to the next, nor wraps, over the whole range up to and beyond the peak.

    Verifies: ZCD-11
    """
    await start(dut)
    for linear in (0, 1):
        last = 0
        for value in [*range(0, 90_000, 97), *range(90_000, 102_000, 13), 131071]:
            got, _ = await measure(dut, value, 100_000, (1 << 24) - 1, linear)
            assert got >= last, f"{value}: {got} after {last}"
            last = got
        limit = 0.5 if linear else math.asin(LIMIT) / (math.pi / 3)
        assert abs(last - limit * (1 << 24)) < 2**10


@cocotb.test()
async def start_replaces(dut: Any) -> None:
    """A start while one runs gives the second one's result only.

    Verifies: ZCD-11
    """
    await start(dut)
    for after in range(1, LATENCY + 2):
        dut.value_i.value, dut.peak_i.value, dut.interval_i.value, dut.linear_i.value = 30000, 60000, 9000, 0
        dut.start_i.value = 1
        await Timer(CLOCK_NS, "ns")
        dut.start_i.value = 0
        if after > 1:
            await Timer((after - 1) * CLOCK_NS, "ns")
        got, _ = await measure(dut, 30000, 60000, 60000, 0)
        assert abs(got - 30000) <= 20, f"after {after} clocks"


def test_fl_angle_time() -> None:
    """Block test with the divider that fl_crossing_time lends it."""
    run_block_test(
        "angle_bench",
        [
            "zcd/fl_asin_pkg.sv",
            "zcd/fl_interpolator.sv",
            "zcd/fl_angle_time.sv",
            Path(__file__).parent / "angle_bench.sv",
        ],
        __name__,
    )


def test_tables_are_current() -> None:
    """The table in the RTL is the one that the script writes."""
    assert tables.ASIN_FILE.read_text() == tables.asin_package(), "run `python -m fluxlock.generate.tables`"
