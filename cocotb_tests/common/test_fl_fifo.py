# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""FIFO against a queue."""

from __future__ import annotations

import random
from collections import deque
from typing import Any

import cocotb
import pytest

from cocotb_tests.soc.bench import Bench
from fluxlock.cosim.block import run_block_test


@cocotb.test
async def random_traffic(dut: Any) -> None:
    bench = Bench(dut)
    await bench.start(push_i=0, pop_i=0, data_i=0)
    width, depth = len(dut.data_i), int(dut.Depth.value)
    latency = 2 if int(dut.Block.value) else 1
    model: deque[tuple[int, int]] = deque()  # a word, and the step in which it is visible at the earliest
    seen = {"full": 0, "empty": 0, "dropped": 0, "popped in a row": 0}
    popped_before = False
    for step in range(4000):
        # Phases that fill and phases that drain, so that both ends are reached.
        filling = (step // 100) % 2 == 0
        push, pop = random.random() < (0.8 if filling else 0.3), random.random() < (0.3 if filling else 0.8)
        data = random.getrandbits(width)
        dut.push_i.value, dut.pop_i.value, dut.data_i.value = int(push), int(pop), data
        visible, full = bool(model) and model[0][1] <= step, len(model) == depth
        assert dut.valid_o.value == int(visible) and dut.full_o.value == int(full), f"step {step}"
        if visible:
            assert int(dut.data_o.value) == model[0][0], f"step {step}"
        seen["full"] += full
        seen["empty"] += not model
        seen["dropped"] += push and full
        seen["popped in a row"] += pop and visible and popped_before
        popped_before = pop and visible
        if pop and visible:
            model.popleft()
        if push and not full:
            model.append((data, step + latency))
        await bench.clocks()
    assert min(seen.values()) > 20, seen


@pytest.mark.parametrize(("width", "depth", "block"), [(8, 16, 0), (1, 2, 0), (9, 4, 0), (9, 8, 1), (1, 2, 1)])
def test_fl_fifo(width: int, depth: int, block: int) -> None:
    """Order, full and empty, dropped pushes for several sizes, in distributed and in block RAM.

    Verifies: SOC-06
    """
    run_block_test(
        "fl_fifo", ["common/fl_fifo.sv"], __name__, parameters={"Width": width, "Depth": depth, "Block": block}
    )
