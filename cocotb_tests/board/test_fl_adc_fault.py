"""Converter faults as one level, against a model that looks back over the inputs of all clocks."""

from __future__ import annotations

import random
from typing import Any

import cocotb
import pytest

from cocotb_tests.soc.bench import Bench
from fluxlock.cosim.block import run_block_test


def expected(history: list[tuple[int, int, int, int]], late: int) -> int:
    """Causes after these clocks of (valid, bad, missed, gate on)."""
    frames = [i for i, (valid, *_) in enumerate(history) if valid]
    bad = bool(frames) and history[frames[-1]][1] != 0
    good = [i for i in frames if history[i][1] == 0]
    missed = any(m for _, _, m, _ in history[good[-1] if good else 0 :])
    waited = len(history) >= late and all(gate and not valid for valid, _, _, gate in history[-late:])
    return bad | missed << 1 | waited << 2


@cocotb.test
async def follows_the_model(dut: Any) -> None:
    late, bits = int(dut.LateCycles.value), int(dut.Channels.value)
    bench = Bench(dut)
    seen_all = 0
    for valid_share, bad_share, missed_share in [
        (0.1, 0.3, 0.05),
        (0.02, 0.5, 0.01),
        (0.5, 0.0, 0.2),
        (0.01, 0.0, 0.0),
    ]:
        await bench.start(valid_i=0, bad_i=0, missed_i=0, gate_on_i=0) if not seen_all else await reset(bench)
        history: list[tuple[int, int, int, int]] = []
        seen = 0
        for _ in range(1500):
            bad = random.getrandbits(bits) if random.random() < bad_share else 0
            gate = int(random.random() < 0.97)
            inputs = (int(random.random() < valid_share), bad, int(random.random() < missed_share), gate)
            dut.valid_i.value, dut.bad_i.value, dut.missed_i.value, dut.gate_on_i.value = inputs
            history.append(inputs)
            await bench.clocks()
            cause = expected(history, late)
            assert int(dut.cause_o.value) == cause, f"after {history[-late - 2 :]}"
            assert int(dut.fault_o.value) == (cause != 0)
            assert int(dut.seen_o.value) == seen
            seen |= cause
        seen_all |= seen
    assert seen_all == 7


async def reset(bench: Bench) -> None:
    dut = bench.dut
    dut.valid_i.value = dut.missed_i.value = dut.gate_on_i.value = 0
    dut.rst_i.value = 1
    await bench.clocks(2)
    assert dut.fault_o.value == 0 and dut.seen_o.value == 0
    dut.rst_i.value = 0


@pytest.mark.parametrize(("channels", "late"), [(9, 40), (1, 2)])
def test_fl_adc_fault(channels: int, late: int) -> None:
    """Bad, missed and late conversions.

    Verifies: BRD-04
    """
    parameters = {"Channels": channels, "LateCycles": late}
    run_block_test("fl_adc_fault", ["board/fl_adc_fault.sv"], __name__, parameters=parameters)
