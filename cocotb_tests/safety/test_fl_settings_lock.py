# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The lock of the protection's settings: closes with the key only, opens with a reset only, sees every single bit."""

from __future__ import annotations

import random
from typing import Any

import cocotb

from cocotb_tests.soc.bench import Bench
from fluxlock.cosim.block import run_block_test

KEY = 0x10CC


@cocotb.test
async def closes_with_the_key_only(dut: Any) -> None:
    bench = Bench(dut)
    await bench.start(key_i=0, settings_i=0)
    for key in [KEY ^ 1 << bit for bit in range(16)] + random.sample(range(KEY), 50):
        dut.key_i.value = key
        await bench.clocks()
        assert dut.locked_o.value == 0, f"{key:#x} closes the lock"
    dut.key_i.value = KEY
    await bench.clocks()
    assert dut.locked_o.value == 1
    for _ in range(50):
        dut.key_i.value = random.getrandbits(16)
        await bench.clocks()
        assert dut.locked_o.value == 1
    dut.rst_i.value, dut.key_i.value = 1, 0
    await bench.clocks()
    assert dut.locked_o.value == 0


@cocotb.test
async def sees_every_bit(dut: Any) -> None:
    """Open, settings may change; locked, each bit alone is told in the next clock, as long as it differs."""
    bench = Bench(dut)
    width = len(dut.settings_i)
    for settings in (0, 1, (1 << width) - 1, 1 << width - 1, random.getrandbits(width)):
        await bench.start(key_i=0, settings_i=settings)
        for _ in range(5):
            dut.settings_i.value = random.getrandbits(width)
            await bench.clocks()
            assert dut.changed_o.value == 0
        dut.settings_i.value, dut.key_i.value = settings, KEY
        await bench.clocks(2)
        for bit in range(width):
            dut.settings_i.value = settings ^ 1 << bit
            await bench.clocks()
            assert dut.changed_o.value == 1, f"bit {bit}"
            await bench.clocks(3)
            assert dut.changed_o.value == 1, f"bit {bit} is forgotten while it differs"
            dut.settings_i.value = settings
            await bench.clocks()
            assert dut.changed_o.value == 0
        dut.settings_i.value = settings ^ 1
        await bench.clocks()
        assert dut.changed_o.value == 1
        dut.rst_i.value, dut.key_i.value = 1, 0
        await bench.clocks()
        assert dut.changed_o.value == 0 and dut.locked_o.value == 0
        dut.rst_i.value = 0
        for _ in range(3):
            await bench.clocks()
            assert dut.changed_o.value == 0, "what differed before a reset is the setting after it"


def test_fl_settings_lock() -> None:
    """Key, reset and parity.

    Verifies: SAFE-14, SAFE-15
    """
    run_block_test("fl_settings_lock", ["safety/fl_settings_lock.sv"], __name__)
