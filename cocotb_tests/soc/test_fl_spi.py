# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""SPI master: waveform at every clock rate, bytes both ways, and a flash behind the register wrapper."""

from __future__ import annotations

import random
from typing import Any

import cocotb
from cocotb.triggers import FallingEdge

from cocotb_tests.soc.bench import Bench
from fluxlock.cosim.block import run_block_test


@cocotb.test()
@cocotb.parametrize(half=[0, 1, 2, 3, 7, 255])
async def byte_goes_both_ways(dut: Any, half: int) -> None:
    """A device that shows its bit half a period before the rising edge, and takes ours there."""
    dut._log.info("seed %d", cocotb.RANDOM_SEED)
    rng = random.Random(cocotb.RANDOM_SEED)
    bench = Bench(dut)
    await bench.start(cfg_half_cycles_i=half, start_i=0, data_i=0, miso_i=0)
    assert (dut.sck_o.value, dut.busy_o.value) == (0, 0)
    for sent in (0x00, 0xFF, 0xA5, *(rng.randrange(256) for _ in range(3 if half == 255 else 12))):
        answer = rng.randrange(256)
        dut.start_i.value, dut.data_i.value = 1, sent
        dut.miso_i.value = answer >> 7
        await FallingEdge(dut.clk_i)
        dut.start_i.value = rng.randrange(2)  # a start while busy is ignored
        dut.data_i.value = sent ^ 0xFF
        edges: list[tuple[int, int]] = []  # clocks since the start, level
        taken, before, clock = 0, 0, 0
        while dut.busy_o.value == 1:
            level = int(dut.sck_o.value)
            if level != before:
                edges.append((clock, level))
                if level:
                    taken = taken << 1 | int(dut.mosi_o.value)
                else:
                    dut.miso_i.value = answer >> (7 - len(edges) // 2) & 1 if len(edges) < 16 else 0
            before = level
            await FallingEdge(dut.clk_i)
            clock += 1
        dut.start_i.value = 0
        edges.append((clock, int(dut.sck_o.value)))
        step = max(half, 1)
        assert edges == [(step * (i + 1), 1 - i % 2) for i in range(16)], f"half period {half}: edges {edges}"
        assert taken == sent, f"{taken:#04x} on the line for {sent:#04x}"
        assert dut.data_o.value == answer, f"{int(dut.data_o.value):#04x} read for {answer:#04x}"


@cocotb.test()
async def reset_ends_a_byte(dut: Any) -> None:
    bench = Bench(dut)
    await bench.start(cfg_half_cycles_i=2, start_i=1, data_i=0xFF, miso_i=1)
    await bench.clocks(9)
    assert (dut.busy_o.value, dut.sck_o.value) == (1, 0) or dut.sck_o.value == 1
    dut.rst_i.value, dut.start_i.value = 1, 0
    await bench.clocks()
    assert (dut.busy_o.value, dut.sck_o.value, dut.mosi_o.value) == (0, 0, 0)


def test_fl_spi() -> None:
    """SPI master alone.

    Verifies: BOOT-01
    """
    run_block_test("fl_spi", ["soc/fl_spi.sv"], __name__)
