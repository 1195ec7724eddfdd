# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Sine and cosine against floating point, to the published error bound."""

from __future__ import annotations

import math
import random
from typing import Any

import cocotb
import pytest
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, Timer

from cocotb_tests.measured import measured
from fluxlock.cosim.block import run_block_test
from fluxlock.generate import tables

CLOCK_NS = 20
LATENCY = 4  # clocks, published by the module
TURN = 1 << 32
TABLE_ERROR = 1.05e-6  # of full scale, published by the module


async def start(dut: Any) -> None:
    dut.rst_i.value = 1
    dut.valid_i.value = 0
    dut.angle_i.value = 0
    dut.cosine_i.value = dut.scaled_i.value = 0
    Clock(dut.clk_i, CLOCK_NS, unit="ns").start()
    await FallingEdge(dut.clk_i)
    await Timer(3 * CLOCK_NS, "ns")
    dut.rst_i.value = 0
    await Timer(CLOCK_NS, "ns")


async def values(dut: Any, asked: list[tuple[int, int]]) -> list[int]:
    """Result of every (angle, cosine), one a clock; checks latency and valid."""
    found = []
    for i in range(len(asked) + LATENCY):
        dut.valid_i.value = int(i < len(asked))
        dut.angle_i.value, dut.cosine_i.value = asked[i] if i < len(asked) else (0x1234_5678, 1)
        assert int(dut.valid_o.value) == int(i >= LATENCY), f"clock {i}"
        if i >= LATENCY:
            found.append(dut.value_o.value.to_signed())
        await Timer(CLOCK_NS, "ns")
    assert int(dut.valid_o.value) == 0
    return found


def exact(width: int, angle: int, cosine: int) -> float:
    x = 2 * math.pi * angle / TURN
    return ((1 << (width - 1)) - 1) * (math.cos(x) if cosine else math.sin(x))


@cocotb.test()
async def error_is_within_the_bound(dut: Any) -> None:
    """Random angles and those around every line's ends: rounding plus the table's error, at most 1 LSB of 18 bits.

    Verifies: FOC-02
    """
    width = len(dut.value_o.value)
    rng = random.Random(2)
    await start(dut)
    asked = [(rng.randrange(TURN), rng.randrange(2)) for _ in range(8000)]
    asked += [((line << 21) + d & (TURN - 1), line & 1) for line in range(2048) for d in (-16, -1, 0, 1, 1 << 20)]
    found = await values(dut, asked)
    worst = 0.0
    for (angle, cosine), value in zip(asked, found, strict=True):
        error = abs(value - exact(width, angle, cosine))
        bound = 0.5 + TABLE_ERROR * (1 << (width - 1))
        assert error <= bound, f"angle {angle:#010x}, cosine {cosine}: {value}, {error:.3f} LSB off"
        worst = max(worst, error)
    dut._log.info("width %d: worst error %.3f LSB", width, worst)
    measured("sine_lsb", worst)
    assert worst > 0.55, "the angles miss the table's error"
    if width == 18:
        assert worst <= 1.0


@cocotb.test()
async def scaled_values_are_within_the_bound(dut: Any) -> None:
    """With a scale: the values from the second table, mixed with plain ones; without: scaled_i does not count.

    Verifies: FOC-02
    """
    width = len(dut.value_o.value)
    share = int(dut.ScaleNumerator.value) / int(dut.ScaleDenominator.value)
    rng = random.Random(4)
    await start(dut)
    asked = [(rng.randrange(TURN), rng.randrange(2)) for _ in range(4000)]
    asked += [((line << 21) + d & (TURN - 1), line & 1) for line in range(2048) for d in (-16, -1, 0, 1, 1 << 20)]
    scaled = [rng.randrange(2) for _ in asked]
    found = []
    for i in range(len(asked) + LATENCY):
        if i >= LATENCY:
            found.append(dut.value_o.value.to_signed())
        if i < len(asked):
            (dut.angle_i.value, dut.cosine_i.value), dut.scaled_i.value = asked[i], scaled[i]
        await Timer(CLOCK_NS, "ns")
    bound = 0.5 + TABLE_ERROR * (1 << (width - 1))
    for (angle, cosine), with_scale, value in zip(asked, scaled, found, strict=True):
        wanted = exact(width, angle, cosine)
        if with_scale and share < 1:
            wanted *= share * (1 << (width - 1)) / ((1 << (width - 1)) - 1)
        context = f"angle {angle:#010x}, cosine {cosine}, scaled {with_scale}"
        assert abs(value - wanted) <= bound, f"{context}: {value} instead of {wanted:.3f}"


@cocotb.test()
async def quadrants_agree(dut: Any) -> None:
    """Zeros and peaks are exact, half a turn changes the sign and nothing else, cosine leads sine by a quarter.

    Verifies: FOC-02
    """
    width = len(dut.value_o.value)
    one = (1 << (width - 1)) - 1
    await start(dut)
    quarter = TURN // 4
    assert await values(dut, [(k * quarter, 0) for k in range(4)]) == [0, one, 0, -one]
    assert await values(dut, [(k * quarter, 1) for k in range(4)]) == [one, 0, -one, 0]
    rng = random.Random(3)
    angles = [rng.randrange(TURN) for _ in range(500)]
    sines = await values(dut, [(a, 0) for a in angles])
    assert await values(dut, [(a + TURN // 2 & (TURN - 1), 0) for a in angles]) == [-s for s in sines]
    assert await values(dut, [(a - quarter & (TURN - 1), 1) for a in angles]) == sines


@pytest.mark.parametrize(("width", "scale"), [(18, (1, 1)), (21, (1, 1)), (21, (2, 3)), (21, (4, 5))])
def test_fl_sincos(width: int, scale: tuple[int, int]) -> None:
    """Sine block test over widths and scales."""
    parameters = {"Width": width, "ScaleNumerator": scale[0], "ScaleDenominator": scale[1]}
    run_block_test("fl_sincos", ["common/fl_sine_pkg.sv", "common/fl_sincos.sv"], __name__, parameters=parameters)


def test_table_is_current() -> None:
    """The table in the RTL is the one that the script writes."""
    assert tables.SINE_FILE.read_text() == tables.sine_package(), "run `python -m fluxlock.generate.tables`"
