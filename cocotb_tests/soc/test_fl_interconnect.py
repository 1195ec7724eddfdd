# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Register bus: windows, unmapped accesses, one strobe an access."""

from __future__ import annotations

import random
from typing import Any

import cocotb

from cocotb_tests.soc.bench import Bench
from fluxlock.cosim.block import run_block_test

BLOCKS = 10
DECODED = 4  # address bits that a block decodes in this build
WINDOW = 0x1000


def block_data(block: int) -> int:
    return 0x1000_0000 * block + 0x0ABC_DEF0 + block


async def access(bench: Bench, adr: int, write: int | None) -> tuple[int, int, list[int]]:
    """One access at a byte address: read data, clocks to the acknowledge, the strobes of each clock."""
    dut = bench.dut
    dut.adr_i.value, dut.we_i.value, dut.sel_i.value = adr >> 2, int(write is not None), 0xF
    dut.wdat_i.value = write or 0
    dut.stb_i.value = 1
    strobes: list[int] = []
    while True:
        await cocotb.triggers.Timer(5, "ns")
        strobes.append(int(dut.stb_o.value))
        request = int(dut.req_o.value)
        if strobes[-1]:
            assert request == (int(dut.we_i.value) << 48 | (adr & 0xFFF) << 36 | (write or 0) << 4 | 0xF), hex(request)
        await bench.clocks()
        if dut.ack_o.value == 1:
            break
        assert len(strobes) < 10, f"access to {adr:#x} hangs"
    strobes.append(int(dut.stb_o.value))
    data = int(dut.rdat_o.value)
    await bench.clocks(random.choice([0, 0, 1]))
    dut.stb_i.value = 0
    await bench.clocks()
    return data, len(strobes) - 1, strobes


@cocotb.test
async def windows_and_unmapped(dut: Any) -> None:
    bench = Bench(dut)
    await bench.start(
        stb_i=0,
        we_i=0,
        adr_i=0,
        wdat_i=0,
        sel_i=0,
        rdat_i=sum(block_data(i) << 32 * i for i in range(BLOCKS)),
    )
    mapped = [WINDOW * block + 4 * word for block in range(BLOCKS) for word in (0, 3)]
    offsets = [WINDOW * block + offset for block in (0, 5, 9) for offset in (16, 0x40, 0x800, 0xFFC)]
    pages = [WINDOW * page for page in (10, 11, 15, 16, 32, 0x100, 0x10000, 0x3FFFF)]
    for adr in mapped + offsets + pages:
        block = adr // WINDOW if adr in mapped else None
        for write in (None, random.getrandbits(32)):
            if write is None:
                # What an earlier access left must not show through.
                assert (await access(bench, 0, None))[0] == block_data(0)
            data, clocks, strobes = await access(bench, adr, write)
            assert clocks == 1, f"{adr:#x}: {clocks} clocks"
            assert strobes == [1 << block if block is not None else 0, 0], f"{adr:#x}: {strobes}"
            if write is None:
                assert data == (block_data(block) if block is not None else 0), f"{adr:#x}: {data:#x}"


@cocotb.test
async def held_strobe_repeats_every_second_clock(dut: Any) -> None:
    """Back-to-back accesses: one strobe for each acknowledge."""
    bench = Bench(dut)
    await bench.start(stb_i=1, we_i=0, adr_i=0, wdat_i=0, sel_i=15, rdat_i=0)
    strobes = acks = 0
    for _ in range(100):
        await cocotb.triggers.Timer(5, "ns")
        strobes += int(dut.stb_o.value)
        acks += int(dut.ack_o.value)
        await bench.clocks()
    assert strobes == acks == 50


def test_fl_interconnect() -> None:
    """Decoding, unmapped windows and offsets, exactly one strobe, answer in the next clock.

    Verifies: SOC-10, SOC-11
    """
    width = int("".join(f"{DECODED:x}" for _ in range(BLOCKS)), 16)
    run_block_test(
        "fl_interconnect",
        ["soc/fl_bus_pkg.sv", "soc/fl_interconnect.sv"],
        __name__,
        parameters={"Blocks": BLOCKS, "AddressWidth": f"40'h{width:x}"},
    )
