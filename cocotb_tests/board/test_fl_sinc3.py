# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Sinc decimator against the convolution that it stands for, in exact integers."""

from __future__ import annotations

import math
import random
from functools import cache
from typing import Any

import cocotb
import numpy as np
import pytest

from cocotb_tests.soc.bench import Bench
from fluxlock.cosim.block import run_block_test

LATENCY = 5


@cache
def response(ratio: int) -> np.ndarray:
    """Impulse response: three means of `ratio` bits in a row, times ratio^3."""
    box = np.ones(ratio, dtype=object)
    return np.convolve(np.convolve(box, box), box)


def expected(bits: list[int], ratio: int) -> int:
    """Code of the last 3 * ratio bits; the last two of them do not count yet."""
    window = np.array(bits[-3 * ratio : -2], dtype=object)
    return min(int(window @ response(ratio)) * 4096 // ratio**3, 4095)


class Model:
    """What comes out and when, from the inputs of all clocks."""

    def __init__(self, channels: int) -> None:
        self.channels, self.ratio, self.clock = channels, 0, 0
        self.bits: list[list[int]] = []
        self.due: dict[int, list[int]] = {}

    def step(self, log2: int, sync: int, valid: int, bits: int) -> None:
        if sync:
            self.ratio = 1 << min(max(log2, 4), 8)
            self.bits = []
        if valid:
            self.bits.append([bits >> i & 1 for i in range(self.channels)])
            if len(self.bits) >= 3 * self.ratio and len(self.bits) % self.ratio == 0:
                codes = [expected([b[i] for b in self.bits], self.ratio) for i in range(self.channels)]
                self.due[self.clock + LATENCY] = codes
        self.clock += 1


async def run(dut: Any, model: Model, stream: list[tuple[int, int, int, int]]) -> list[list[int]]:
    """Apply (log2, sync, valid, bits) a clock; compare every clock with the model; the codes that came."""
    bench, got, last = Bench(dut), [], None
    await bench.start(cfg_log2_i=stream[0][0], sync_i=0, bit_valid_i=0, bit_i=0)
    for k, (log2, sync, valid, bits) in enumerate(stream):
        dut.cfg_log2_i.value, dut.sync_i.value, dut.bit_valid_i.value, dut.bit_i.value = log2, sync, valid, bits
        model.step(log2, sync or k == 0, valid, bits)
        await bench.clocks()
        codes = [int(dut.code_o.value) >> 12 * i & 0xFFF for i in range(model.channels)]
        wanted = model.due.get(model.clock)
        assert int(dut.valid_o.value) == (wanted is not None), f"clock {model.clock}"
        if wanted is not None:
            assert codes == wanted, f"clock {model.clock}, ratio {model.ratio}"
            got.append(codes)
        elif last is not None:
            assert codes == last, "code changed without valid"
        last = codes if got else None
    return got


@cocotb.test
@cocotb.parametrize(log2=[4, 7, 8])
async def equals_the_convolution(dut: Any, log2: int) -> None:
    channels = int(dut.Channels.value)
    density = [random.choice([0.0, 0.03, 0.5, 0.97, 1.0, random.random()]) for _ in range(channels)]
    pace = random.choice([1.0, 0.5, 0.25])
    stream = []
    for _ in range(int(7.5 * (1 << log2) / pace)):
        bits = sum((random.random() < density[i]) << i for i in range(channels))
        stream.append((log2, 0, int(random.random() < pace), bits))
    assert len(await run(dut, Model(channels), stream)) >= 3


@cocotb.test
async def starts_windows_on_demand(dut: Any) -> None:
    channels = int(dut.Channels.value)
    stream = []
    for _ in range(25):
        log2 = random.choice([0, 3, 4, 4, 5, 5, 6, 9 if channels == 1 else 4])
        length = (1 << max(log2, 4)) * random.choice([1, 3, 3, 4]) + random.choice([-1, 0, 1, 2, 7])
        pace = random.choice([1.0, 0.5])
        for k in range(int(length / pace)):
            others = random.randrange(10)  # the ratio counts at the sync only
            valid = int(random.random() < pace)
            stream.append((others if k else log2, int(k == 0), valid, random.getrandbits(channels)))
    assert await run(dut, Model(channels), stream)


@cocotb.test
async def shows_full_scale_and_a_sine(dut: Any) -> None:
    channels = int(dut.Channels.value)
    ones = (1 << channels) - 1
    for pattern, code in [([0], 0), ([ones], 4095), ([0, ones], 2048), ([ones, ones, 0, 0], 2048)]:
        stream = [(4, 0, 1, pattern[k % len(pattern)]) for k in range(100)]
        got = await run(dut, Model(channels), stream)
        assert all(abs(c - code) <= 8 * (len(pattern) > 2) for codes in got for c in codes), f"{pattern}: {got}"
    # Second-order modulator, 0.6 of full scale, 64 bits a code: the sine comes back delayed by (3R + 1) / 2 bits.
    ratio, period, first, second, bits = 64, 2048, 0.0, 0.0, []
    for k in range(period):
        x = 0.6 * math.sin(2 * math.pi * k / period)
        y = 1.0 if second >= 0 else -1.0
        first += x - y
        second += first - y
        bits.append(int(y > 0))
    got = await run(dut, Model(channels), [(6, 0, 1, b * ones) for b in bits])
    for n, codes in enumerate(got):
        last = (n + 3) * ratio - 1
        middle = last - (3 * ratio + 1) / 2
        wanted = 2048 + 2048 * 0.6 * math.sin(2 * math.pi * middle / period)
        assert abs(codes[0] - wanted) < 12, f"code {n}: {codes[0]}, {wanted:.1f}"


@cocotb.test
async def finds_a_stuck_stream(dut: Any) -> None:
    channels, limit = int(dut.Channels.value), int(dut.StuckBits.value)
    bench = Bench(dut)
    await bench.start(cfg_log2_i=4, sync_i=0, bit_valid_i=0, bit_i=0)
    runs = [0] * channels
    before = [-1] * channels
    seen = 0
    for _ in range(8 * limit):
        valid, bits = int(random.random() < 0.8), 0
        for i in range(channels):
            change = random.random() < 1.2 / limit
            bits |= (before[i] ^ 1 if change and before[i] >= 0 else max(before[i], 0)) << i
        dut.bit_valid_i.value, dut.bit_i.value = valid, bits
        if valid:
            for i in range(channels):
                runs[i] = runs[i] + 1 if (bits >> i & 1) == before[i] else 1
                before[i] = bits >> i & 1
        await bench.clocks()
        stuck = int(dut.stuck_o.value)
        for i in range(channels):
            assert (stuck >> i & 1) == (runs[i] >= limit), f"{runs[i]} equal bits"
        seen |= stuck
    assert seen


@pytest.mark.parametrize(("channels", "stuck_bits"), [(3, 256), (1, 20)])
def test_fl_sinc3(channels: int, stuck_bits: int) -> None:
    """Codes and their clocks at several ratios and paces, windows started at any time, stuck streams.

    Verifies: BRD-05
    """
    parameters = {"Channels": channels, "StuckBits": stuck_bits}
    run_block_test("fl_sinc3", ["board/fl_sinc3.sv"], __name__, parameters=parameters)
