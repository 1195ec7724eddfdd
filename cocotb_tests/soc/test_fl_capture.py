# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Capture buffer against a list of what was offered."""

from __future__ import annotations

import random
from dataclasses import dataclass
from typing import Any

import cocotb
import pytest

from cocotb_tests.soc.bench import Bench
from fluxlock.cosim.block import run_block_test

CONTROL, LANES, STATUS, READ_ADDRESS, DATA = 0x00, 0x04, 0x08, 0x0C, 0x10
NOW, TRIP, COMMUTATION, SECTOR0 = range(4)
BUSY, DONE = 1, 2
MASK18 = (1 << 18) - 1


def signed(value: int, bits: int) -> int:
    return value - (1 << bits) if value >> (bits - 1) & 1 else value


@dataclass
class Sample:
    """One offered sample set, as the sixteen lane sources."""

    sources: list[int]


class Scope:
    """Drives sample sets and triggers and remembers what it offered."""

    def __init__(self, bench: Bench, channels: int) -> None:
        self.bench, self.channels = bench, channels
        self.offered: list[Sample] = []

    async def sample(self, **pulses: int) -> None:
        """Offer one random sample set, with triggers in the same clock."""
        dut = self.bench.dut
        values = [random.getrandbits(18) for _ in range(self.channels)]
        time, duty = random.getrandbits(18), random.getrandbits(18)
        on, sector, tripped = random.getrandbits(1), random.randrange(6), random.getrandbits(1)
        dut.sample_i.value = sum(v << 18 * i for i, v in enumerate(values))
        dut.sample_time_i.value, dut.duty_q2_i.value = time, duty
        dut.sample_on_i.value, dut.sample_sector_i.value, dut.tripped_i.value = on, sector, tripped
        dut.sample_valid_i.value = 1
        for name, value in pulses.items():
            getattr(dut, name).value = value
        sources = values + [0] * (13 - self.channels) + [tripped << 5 | on << 4 | sector, time, duty]
        self.offered.append(Sample(sources))
        await self.bench.clocks()
        dut.sample_valid_i.value = 0
        dut.trip_i.value = dut.comm_applied_i.value = 0
        await self.bench.clocks(random.randrange(3))

    async def arm(self, trigger: int, pre: int, decimation: int, lanes: list[int]) -> None:
        await self.bench.write(LANES, sum(lane << 8 * i for i, lane in enumerate(lanes)))
        await self.bench.write(CONTROL, pre << 16 | decimation << 8 | trigger << 2 | 1)
        await self.bench.clocks(2)
        self.offered.clear()

    async def records(self, depth: int) -> list[list[int]]:
        out = []
        for record in range(depth):
            await self.bench.write(READ_ADDRESS, record)
            await self.bench.clocks()
            out.append([signed(await self.bench.read(DATA + 4 * lane), 32) for lane in range(4)])
        return out

    def expected(self, first: int, depth: int, decimation: int, lanes: list[int]) -> list[list[int]]:
        kept = self.offered[:: decimation + 1][first : first + depth]
        return [[signed(s.sources[lane], 18) for lane in lanes] for s in kept]


async def setup(dut: Any) -> tuple[Bench, Scope, int]:
    bench = Bench(dut)
    inputs = ("sample_valid_i", "sample_i", "sample_time_i", "sample_on_i", "sample_sector_i", "duty_q2_i")
    await bench.start(**dict.fromkeys((*inputs, "trip_i", "tripped_i", "comm_applied_i", "sector_i"), 0))
    return bench, Scope(bench, int(dut.Channels.value)), int(dut.Depth.value)


@cocotb.test
@cocotb.parametrize(decimation=[0, 2])
async def now(dut: Any, decimation: int) -> None:
    bench, scope, depth = await setup(dut)
    assert await bench.read(STATUS) == depth << 16
    for lanes in ([0, 1, 2, 3], [13, 14, 15, 12], [scope.channels - 1, 0, 0, 14]):
        await scope.arm(NOW, 0, decimation, lanes)
        assert await bench.read(STATUS) == depth << 16 | BUSY
        for _ in range((depth - 1) * (decimation + 1)):
            await scope.sample()
        assert await bench.read(STATUS) == depth << 16 | BUSY, "complete too early"
        for _ in range(decimation + 1):
            await scope.sample()
        assert await bench.read(STATUS) == depth << 16 | DONE
        for _ in range(5):
            await scope.sample()  # must not be stored
        assert await scope.records(depth) == scope.expected(0, depth, decimation, lanes)


@cocotb.test
@cocotb.parametrize(trigger=[TRIP, COMMUTATION, SECTOR0], share=[0.0, 0.4, 1.0])
async def triggered(dut: Any, trigger: int, share: float) -> None:
    """Pre-trigger records from none to all but one; triggers that do not count before and after."""
    bench, scope, depth = await setup(dut)
    pre, lanes = round(share * (depth - 1)), [0, 14, 15, 1]
    fire = {
        TRIP: {"trip_i": 1},
        COMMUTATION: {"comm_applied_i": 1, "sector_i": 3},
        SECTOR0: {"comm_applied_i": 1, "sector_i": 0},
    }[trigger]
    other = {
        TRIP: {"comm_applied_i": 1, "sector_i": 0},
        COMMUTATION: {"trip_i": 1},
        SECTOR0: {"comm_applied_i": 1, "sector_i": 1},
    }[trigger]
    await scope.arm(trigger, pre, 0, lanes)
    for _ in range(max(pre - 1, 0)):
        await scope.sample(**fire)  # too early: the pre-trigger records are not complete
    for _ in range(depth + 7 if pre else 0):
        await scope.sample(**other)
    assert await bench.read(STATUS) == depth << 16 | BUSY
    for name, value in fire.items():
        getattr(dut, name).value = value
    await bench.clocks()
    dut.trip_i.value = dut.comm_applied_i.value = 0
    at = len(scope.offered)
    for _ in range(depth - pre):
        assert not await bench.read(STATUS) & DONE
        await scope.sample(**fire)
    assert await bench.read(STATUS) == depth << 16 | DONE
    assert await scope.records(depth) == scope.expected(at - pre, depth, 0, lanes)


@cocotb.test
async def arming_again_abandons_and_event_comes_once(dut: Any) -> None:
    bench, scope, depth = await setup(dut)
    events = 0

    async def count() -> None:
        nonlocal events
        while True:
            await cocotb.triggers.FallingEdge(dut.clk_i)
            events += int(dut.done_event_o.value)

    cocotb.start_soon(count())
    await scope.arm(NOW, 0, 0, [0, 1, 2, 3])
    for _ in range(depth // 2):
        await scope.sample()
    await scope.arm(NOW, 0, 0, [3, 2, 1, 0])
    for _ in range(depth):
        await scope.sample()
    await bench.clocks(5)
    assert events == 1
    assert await scope.records(depth) == scope.expected(0, depth, 0, [3, 2, 1, 0])


@pytest.mark.parametrize(("channels", "depth"), [(9, 16), (13, 64)])
def test_fl_capture(channels: int, depth: int) -> None:
    """Lanes, decimation, every trigger with pre-trigger records, re-arming.

    Verifies: SOC-12, SOC-13
    """
    run_block_test(
        "fl_capture_wb",
        ["soc/fl_bus_pkg.sv", "soc/fl_capture.sv", "soc/fl_capture_wb.sv"],
        __name__,
        parameters={"Channels": channels, "Depth": depth},
        registers=["capture"],
    )
