# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Timing contracts of `docs/architecture.md` as diagrams: dead time, trip, update event."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import cocotb
import pytest

from cocotb_tests.safety.test_fl_gate_guard import RESET_WAIT, GuardTb
from cocotb_tests.safety.test_fl_trip import CODE_TO_OFF, MIDDLE, TripTb
from cocotb_tests.soc.bench import Bench
from cocotb_tests.soc.test_fl_timer import TICK_PERIOD, TICK_TO_UPDATE, UPDATE
from cocotb_tests.timing.recorder import Recorder, compare
from fluxlock.cosim.block import run_block_test
from fluxlock.paths import ROOT

DEAD_TIME = 4
TICK = 12


def reader(handle: Any, mask: int = -1) -> Callable[[], int]:
    """What reads some bits of a signal."""
    return lambda: int(handle.value) & mask


@cocotb.test
async def dead_time(dut: Any) -> None:
    tb = GuardTb(dut)
    await tb.start()
    for _ in range(RESET_WAIT + 4):
        await tb.step(enable_i=1, req_h_i=1, dead_time_i=DEAD_TIME)
    lines = {name: reader(getattr(dut, name), 1) for name in ("req_h_i", "req_l_i", "gate_h_o", "gate_l_o")}
    recorder = Recorder(dut.clk_i, lines)
    for _ in range(2):
        await tb.step()
    for _ in range(DEAD_TIME + 4):
        await tb.step(req_h_i=0, req_l_i=1)
    for _ in range(DEAD_TIME + 4):
        await tb.step(req_h_i=1, req_l_i=0)
    low, high = recorder.values["gate_l_o"], recorder.values["gate_h_o"]
    assert low.index(1) - high.index(0) == DEAD_TIME
    compare("dead-time", recorder.diagram(f"One leg, dead time {DEAD_TIME} clocks"))


@cocotb.test
async def over_current(dut: Any) -> None:
    tb = TripTb(dut)
    await tb.start()
    lines = {name: reader(getattr(dut, name)) for name in ("adc_valid_i", "trip_o")}
    lines["gates on"] = lambda: int(tb.gates()).bit_count()
    recorder = Recorder(dut.clk_i, lines, numbers=("gates on",))
    await tb.clocks(1)
    await tb.sample()
    await tb.clocks(3)
    await tb.sample(c3=MIDDLE + 1001)
    await tb.clocks(5)
    valid, gates = recorder.values["adc_valid_i"], recorder.values["gates on"]
    second = valid.index(1, valid.index(1) + 1)
    assert gates.index(0) - second == CODE_TO_OFF
    compare("over-current", recorder.diagram("Second sample set: phase current over its limit"))


@cocotb.test
async def update_event(dut: Any) -> None:
    bench = Bench(dut)
    await bench.start(sync_i=0)
    await bench.write(TICK_PERIOD, TICK)
    await bench.wait_high(dut.tick_o, 3 * TICK)
    await bench.wait_high(dut.tick_o, 3 * TICK)
    names = {"commit is written": dut.stb_i, "tick_o": dut.tick_o, "update_o": dut.update_o}
    recorder = Recorder(dut.clk_i, {name: reader(handle) for name, handle in names.items()})
    await bench.clocks(4)
    await bench.write(UPDATE, 1)
    await bench.clocks(TICK)
    ticks = [k for k, high in enumerate(recorder.values["tick_o"]) if high]
    assert recorder.values["update_o"].index(1) - ticks[1] == TICK_TO_UPDATE
    compare("update-event", recorder.diagram(f"Control tick every {TICK} clocks, one commit"))


BENCHES: dict[str, tuple[str, list[Any], dict[str, Any]]] = {
    "dead_time": (
        "fl_gate_guard",
        ["safety/fl_gate_guard.sv"],
        {"parameters": {"Phases": 3, "HighActiveLow": 0, "LowActiveLow": 0}, "extra_env": {"GUARD_POLARITY": "0"}},
    ),
    "over_current": (
        "fl_safety_chain",
        [
            *("safety/fl_sync.sv", "safety/fl_trip.sv", "safety/fl_gate_guard.sv"),
            ROOT / "cocotb_tests" / "safety" / "fl_safety_chain.sv",
        ],
        {},
    ),
    "update_event": (
        "fl_timer_wb",
        ["soc/fl_bus_pkg.sv", "soc/fl_interval.sv", "soc/fl_timer.sv", "soc/fl_timer_wb.sv"],
        {"registers": ["timer"]},
    ),
}


@pytest.mark.parametrize("case", BENCHES)
def test_diagrams(case: str) -> None:
    """The timing diagrams of the pages are what the RTL does, and meet the contract that they illustrate.

    Verifies: DOC-14
    """
    top, sources, more = BENCHES[case]
    run_block_test(top, sources, __name__, testcase=case, **more)
