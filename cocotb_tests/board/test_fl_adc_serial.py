# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Serial converter interface at its pins, against a model of the converters made from their timing table."""

from __future__ import annotations

import os
import random
from dataclasses import replace
from typing import Any

import cocotb
import pytest
from cocotb.triggers import Timer

from cocotb_tests.board.serial_converter import FAST, SLOW, TABLE, SerialConverters
from cocotb_tests.soc.bench import Bench
from fluxlock.cosim.block import run_block_test

CYCLES = {14: 30, 16: 34}  # strobe to valid
LIMIT_NS, CLOCK_NS = 700, 20
QUIET_CYCLES = 2
RELEASE_CYCLES = 10
PATHS = {"slow": SLOW, "fast": FAST}[os.environ.get("PATHS", "slow")]


class Reader:
    """Bench with converters: asks for a conversion and returns what came."""

    def __init__(self, dut: Any, **model: Any) -> None:
        self.dut, self.bench = dut, Bench(dut)
        self.channels, self.frame = int(dut.Channels.value), int(dut.FrameBits.value)
        self.converters = SerialConverters(dut, self.channels, **{"paths": PATHS, **model})

    async def start(self) -> None:
        """Reset, and the frame that wakes the converters."""
        await self.bench.start(strobe_i=0, sdata_i=(1 << self.channels) - 1)
        for _ in range(45):
            await self.bench.clocks()
            assert self.dut.valid_o.value == 0, "the frame after reset gives codes"
        assert self.converters.frames == [self.frame], "no frame after reset"

    async def convert(self) -> tuple[list[int], int]:
        """Strobe; codes and bad channels at valid."""
        self.dut.strobe_i.value = 1
        await self.bench.clocks()
        self.dut.strobe_i.value = 0
        assert self.dut.cs_no.value == 0, "hold is not one clock after the strobe"
        clocks = 1 + await self.bench.wait_high(self.dut.valid_o, 60)
        assert clocks == CYCLES[self.frame] and clocks * CLOCK_NS <= LIMIT_NS, clocks
        assert self.dut.cs_no.value == 1
        return self.codes(), int(self.dut.bad_o.value)

    def codes(self) -> list[int]:
        packed = int(self.dut.code_o.value)
        return [packed >> 12 * i & 0xFFF for i in range(self.channels)]

    def draw(self) -> list[int]:
        """New codes for the converters, extremes among them."""
        extremes = [0, 0xFFF, 0x800, 0x7FF, 0xAAA, 0x555]
        drawn = [random.choice([*extremes, random.getrandbits(12)]) for _ in range(self.channels)]
        self.converters.codes = list(drawn)
        return drawn


@cocotb.test
async def reads_random_codes(dut: Any) -> None:
    reader = Reader(dut)
    await reader.start()
    for gap in [0, 0, 1, 7, 8, 9, 19, *(random.randrange(40) for _ in range(20))]:
        wanted = reader.draw()
        dut.strobe_i.value = 1
        await reader.bench.clocks()
        reader.converters.codes = [random.getrandbits(12) for _ in wanted]  # what comes after the hold does not count
        dut.strobe_i.value = 0
        assert 1 + await reader.bench.wait_high(dut.valid_o, 60) == CYCLES[reader.frame]
        assert (reader.codes(), int(dut.bad_o.value)) == (wanted, 0)
        await reader.bench.clocks(QUIET_CYCLES + gap)
        assert dut.valid_o.value == 0 and reader.codes() == wanted and dut.bad_o.value == 0
    assert reader.converters.frames == [reader.frame] * 28


@cocotb.test
async def ignores_and_reports_early_strobes(dut: Any) -> None:
    reader = Reader(dut)
    await reader.start()
    for _ in range(12):
        wanted = reader.draw()
        dut.strobe_i.value = 1
        await reader.bench.clocks()
        valid, frames = [], len(reader.converters.frames)
        for count in range(1, CYCLES[reader.frame] + QUIET_CYCLES):
            early = random.getrandbits(1)
            dut.strobe_i.value = early
            await reader.bench.clocks()
            assert dut.missed_o.value == early, f"strobe {early} at clock {count}"
            if dut.valid_o.value == 1:
                valid.append(count + 1)
        dut.strobe_i.value = 0
        assert valid == [CYCLES[reader.frame]] and reader.codes() == wanted
        await reader.bench.clocks(random.randrange(1, 5))
        assert dut.missed_o.value == 0 and len(reader.converters.frames) == frames + 1


@cocotb.test
async def finds_faulty_channels(dut: Any) -> None:
    reader = Reader(dut)
    await reader.start()
    for _ in range(12):
        channel, level = random.randrange(reader.channels), random.getrandbits(1)
        wanted = reader.draw()
        reader.converters.stick({channel: level})  # 1 is also what the pull-up shows where no part is fitted
        await reader.bench.clocks(RELEASE_CYCLES + 4)
        codes, bad = await reader.convert()
        assert bad == 1 << channel, f"line {channel} stuck at {level}: bad {bad:b}"
        assert [c for i, c in enumerate(codes) if i != channel] == [w for i, w in enumerate(wanted) if i != channel]
        await reader.bench.clocks(QUIET_CYCLES)
        # Too soon after the frame for the pull-up: a line at 0 is not judged, one at 1 is.
        _, bad = await reader.convert()
        assert bad == level << channel
        reader.converters.stick({})
        await reader.bench.clocks(QUIET_CYCLES + 20)
        wanted = reader.draw()
        assert await reader.convert() == (wanted, 0)
    await reader.bench.clocks(QUIET_CYCLES)
    reader.converters.trailing = [1] * reader.channels
    _, bad = await reader.convert()
    assert bad == ((1 << reader.channels) - 1 if reader.frame == 16 else 0)


@cocotb.test
async def wakes_converters_after_a_reset_in_a_frame(dut: Any) -> None:
    reader = Reader(dut)
    await reader.start()
    reader.converters.checked = False
    for cut in range(1, CYCLES[reader.frame] + 3):
        dut.strobe_i.value = 1
        await reader.bench.clocks()
        dut.strobe_i.value = 0
        await reader.bench.clocks(cut)
        dut.rst_i.value = 1
        await reader.bench.clocks(2)
        assert dut.cs_no.value == 1 and dut.sclk_o.value == 1
        dut.rst_i.value = 0
        await reader.bench.clocks(45)
        wanted = reader.draw()
        assert await reader.convert() == (wanted, 0), f"reset {cut} clocks after the hold"
        await reader.bench.clocks(QUIET_CYCLES + 20)


@cocotb.test
async def a_part_slower_than_allowed_is_misread(dut: Any) -> None:
    """The model bites: two nanoseconds more than the slowest allowed reach the flip-flop too late."""
    reader = Reader(dut, paths=SLOW, table=replace(TABLE, access=TABLE.access + 2))
    await reader.start()
    wrong = 0
    for _ in range(10):
        wanted = reader.draw()
        codes, bad = await reader.convert()
        wrong += codes != wanted or bad != 0
        await reader.bench.clocks(20)
    assert wrong > 0
    await Timer(CLOCK_NS, "ns")


@pytest.mark.parametrize("paths", ["slow", "fast"])
@pytest.mark.parametrize(("channels", "frame_bits"), [(9, 16), (9, 14), (1, 16)])
def test_fl_adc_serial(channels: int, frame_bits: int, paths: str) -> None:
    """Hold instant, timing table and codes at the slowest and fastest parts and boards; faulty lines; early strobes.

    Verifies: SOC-14, BRD-01, BRD-02, BRD-03
    """
    run_block_test(
        "fl_adc_serial",
        ["board/fl_adc_serial.sv"],
        __name__,
        parameters={"Channels": channels, "FrameBits": frame_bits, "ReleaseCycles": RELEASE_CYCLES},
        extra_env={"PATHS": paths},
    )
