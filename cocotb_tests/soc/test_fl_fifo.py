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
    model: deque[int] = deque()
    seen = {"full": 0, "empty": 0, "dropped": 0}
    for step in range(4000):
        # Phases that fill and phases that drain, so that both ends are reached.
        filling = (step // 100) % 2 == 0
        push, pop = random.random() < (0.8 if filling else 0.3), random.random() < (0.3 if filling else 0.8)
        data = random.getrandbits(width)
        dut.push_i.value, dut.pop_i.value, dut.data_i.value = int(push), int(pop), data
        assert dut.valid_o.value == int(bool(model)) and dut.full_o.value == int(len(model) == depth)
        if model:
            assert int(dut.data_o.value) == model[0], f"step {step}"
        seen["full"] += len(model) == depth
        seen["empty"] += not model
        seen["dropped"] += push and len(model) == depth
        was_full = len(model) == depth
        if pop and model:
            model.popleft()
        if push and not was_full:
            model.append(data)
        await bench.clocks()
    assert min(seen.values()) > 20, seen


@pytest.mark.parametrize(("width", "depth"), [(8, 16), (1, 2), (9, 4)])
def test_fl_fifo(width: int, depth: int) -> None:
    """Order, full and empty, dropped pushes for several sizes.

    Verifies: SOC-06
    """
    run_block_test("fl_fifo", ["soc/fl_fifo.sv"], __name__, parameters={"Width": width, "Depth": depth})
