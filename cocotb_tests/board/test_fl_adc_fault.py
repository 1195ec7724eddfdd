# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Converter faults as one level, against a model that looks back over the inputs of all clocks."""

from __future__ import annotations

import random
from typing import Any

import cocotb
import pytest

from cocotb_tests.soc.bench import Bench
from fluxlock.cosim.block import run_block_test


def expected(history: list[tuple[int, int, int]]) -> int:
    """Causes after these clocks of (valid, bad, missed)."""
    bad = next((bits != 0 for valid, bits, _ in reversed(history) if valid), False)
    missed = False
    for valid, bits, miss in reversed(history):
        missed |= bool(miss)
        if valid and bits == 0:
            break
    return bad | missed << 1


@cocotb.test
async def follows_the_model(dut: Any) -> None:
    bits = int(dut.Channels.value)
    bench = Bench(dut)
    seen_all = 0
    for valid_share, bad_share, missed_share in [
        (0.1, 0.3, 0.05),
        (0.02, 0.5, 0.01),
        (0.5, 0.0, 0.2),
        (0.01, 0.0, 0.0),
    ]:
        await bench.start(valid_i=0, bad_i=0, missed_i=0) if not seen_all else await reset(bench)
        history: list[tuple[int, int, int]] = []
        seen = 0
        for _ in range(1500):
            bad = random.getrandbits(bits) if random.random() < bad_share else 0
            inputs = (int(random.random() < valid_share), bad, int(random.random() < missed_share))
            dut.valid_i.value, dut.bad_i.value, dut.missed_i.value = inputs
            history.append(inputs)
            await bench.clocks()
            cause = expected(history)
            assert int(dut.cause_o.value) == cause, f"after {history[-40:]}"
            assert int(dut.fault_o.value) == (cause != 0)
            assert int(dut.seen_o.value) == seen
            seen |= cause
        seen_all |= seen
    assert seen_all == 3


async def reset(bench: Bench) -> None:
    dut = bench.dut
    dut.valid_i.value = dut.missed_i.value = 0
    dut.rst_i.value = 1
    await bench.clocks(2)
    assert dut.fault_o.value == 0 and dut.seen_o.value == 0
    dut.rst_i.value = 0


@pytest.mark.parametrize("channels", [9, 1])
def test_fl_adc_fault(channels: int) -> None:
    """Bad and missed conversions.

    Verifies: BRD-04
    """
    run_block_test("fl_adc_fault", ["board/fl_adc_fault.sv"], __name__, parameters={"Channels": channels})
