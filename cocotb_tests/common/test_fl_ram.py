# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Dual-port RAM against a dictionary, contents from a file."""

from __future__ import annotations

import os
import random
from pathlib import Path
from typing import Any

import cocotb

from cocotb_tests.soc.bench import Bench
from fluxlock.base.paths import BUILD
from fluxlock.cosim.block import run_block_test

WORDS = 64


def write_image(path: Path) -> list[int]:
    """An image with a value of its own in every word."""
    words = [(0x9E3779B1 * (i + 1)) & 0xFFFFFFFF for i in range(WORDS)]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("".join(f"{word:08x}\n" for word in words))
    return words


@cocotb.test
async def against_model(dut: Any) -> None:
    bench = Bench(dut)
    cocotb.start_soon(cocotb.clock.Clock(dut.clk_i, 20, unit="ns").start())
    model = [int(line, 16) for line in Path(os.environ["FL_RAM_IMAGE"]).read_text().split()]
    expect_a: int | None = None
    expect_b: int | None = None
    await bench.clocks()
    for step in range(4000):
        a_en, a_adr = random.getrandbits(1), random.randrange(WORDS)
        b_adr, data = random.randrange(WORDS), random.getrandbits(32)
        lanes = random.getrandbits(4) if random.random() < 0.3 else 0
        # One word is never read and written in the same clock (no bypass).
        if lanes and a_adr == b_adr:
            a_en = 0
        for name, value in (
            ("a_en", a_en),
            ("a_adr", a_adr),
            ("b_adr", b_adr),
            ("b_wdat", data),
        ):
            getattr(dut, name + "_i").value = value
        dut.b_we_i.value = lanes
        await bench.clocks()
        if a_en:
            expect_a = model[a_adr]
        if not lanes:
            expect_b = model[b_adr]
        else:
            mask = sum(0xFF << 8 * i for i in range(4) if lanes >> i & 1)
            model[b_adr] = model[b_adr] & ~mask | data & mask
            expect_b = None
        if expect_a is not None:
            assert int(dut.a_rdat_o.value) == expect_a, f"port a, step {step}"
        if expect_b is not None:
            assert int(dut.b_rdat_o.value) == expect_b, f"port b, step {step}"


def test_fl_ram() -> None:
    """Contents from the image, byte lanes, port a keeps its output while it is not enabled.

    Verifies: SOC-09
    """
    image = BUILD / "block" / "fl_ram.hex"
    write_image(image)
    run_block_test(
        "fl_ram",
        ["common/fl_ram.sv"],
        __name__,
        parameters={"Words": WORDS, "Init": f'"{image}"'},
        extra_env={"FL_RAM_IMAGE": str(image)},
    )
