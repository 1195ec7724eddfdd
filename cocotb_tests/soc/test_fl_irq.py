# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Interrupt controller: sticky bits, routing, overrun counters."""

from __future__ import annotations

import random
from typing import Any

import cocotb

from cocotb_tests.soc.bench import Bench, request
from fluxlock.cosim.block import run_block_test

PENDING, ENABLE, ROUTE, OVERRUN = range(0, 0x10, 4)
TICK = 0


async def event(bench: Bench, mask: int) -> None:
    bench.dut.event_i.value = mask
    await bench.clocks()
    bench.dut.event_i.value = 0


def lines(dut: Any) -> tuple[int, int]:
    return int(dut.irq_control_o.value), int(dut.irq_deferred_o.value)


@cocotb.test
async def every_source_reaches_the_routed_line(dut: Any) -> None:
    bench = Bench(dut)
    await bench.start(event_i=0)
    for source in range(9):
        bit = 1 << source
        for control in (0, 1):
            await bench.write(ENABLE, bit)
            await bench.write(ROUTE, bit if control else 0x1FF & ~bit)
            assert lines(dut) == (0, 0)
            await event(bench, bit)
            assert lines(dut) == (control, 1 - control), f"source {source}, control {control}: {lines(dut)}"
            assert await bench.read(PENDING) == bit
            await bench.write(ENABLE, 0)
            assert lines(dut) == (0, 0), "a disabled source raises a line"
            await bench.write(PENDING, 0x1FF & ~bit)
            assert await bench.read(PENDING) == bit, "cleared by another source's bit"
            await bench.write(PENDING, bit)
            assert await bench.read(PENDING) == 0


@cocotb.test
async def event_in_the_clock_of_the_clear_wins(dut: Any) -> None:
    bench = Bench(dut)
    await bench.start(event_i=0)
    await event(bench, 0x0C)
    dut.req_i.value = request(PENDING, 0x0C, we=True)
    dut.stb_i.value = 1
    dut.event_i.value = 0x0A
    await bench.clocks()
    dut.stb_i.value = 0
    dut.event_i.value = 0
    assert await bench.read(PENDING) == 0x0A


@cocotb.test
async def random_events_against_model(dut: Any) -> None:
    bench = Bench(dut)
    await bench.start(event_i=0)
    pending = overrun = tick_overrun = 0
    await bench.write(ENABLE, 0x5B)
    await bench.write(ROUTE, 0x13)
    for _ in range(3000):
        events = random.getrandbits(8) & random.getrandbits(8) & random.getrandbits(8)
        clear = random.getrandbits(8) if random.random() < 0.3 else None
        dut.event_i.value = events
        dut.stb_i.value = int(clear is not None)
        dut.req_i.value = request(PENDING, clear or 0, we=True)
        await bench.clocks()
        overrun += (events & pending).bit_count()
        tick_overrun += events & pending & 1
        pending = pending & ~(clear or 0) | events
        active = pending & 0x5B
        assert lines(dut) == (int(active & 0x13 != 0), int(active & ~0x13 != 0)), hex(pending)
    dut.stb_i.value = 0
    dut.event_i.value = 0
    assert await bench.read(PENDING) == pending
    assert await bench.read(OVERRUN) == overrun | tick_overrun << 16 and overrun > 500 and tick_overrun > 50


@cocotb.test
async def overrun_counters_saturate(dut: Any) -> None:
    bench = Bench(dut)
    await bench.start(event_i=0xFF)
    await bench.clocks(0x10000 // 8 + 10)
    dut.event_i.value = 1 << TICK
    await bench.clocks(0x10000)
    dut.event_i.value = 0
    assert await bench.read(OVERRUN) == 0xFFFF_FFFF


def test_fl_irq() -> None:
    """Routing, event against clear, overruns and their saturation.

    Verifies: SOC-04, SOC-05
    """
    run_block_test("fl_irq_wb", ["soc/fl_bus_pkg.sv", "soc/fl_irq.sv", "soc/fl_irq_wb.sv"], __name__, registers=["irq"])
