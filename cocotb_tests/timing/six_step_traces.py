# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Traces of the six-step path: sample, zero crossing, commutation, carrier."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import cocotb

from cocotb_tests.pwm.chain import COMM_TO_GATE, CSC, FIELDS, Chain, Drive, pulse, schedule
from cocotb_tests.pwm.test_fl_carrier import UPDATE_TO_CARRIER
from cocotb_tests.sense.test_fl_sample_scheduler import ONCE, START_TO_STROBE
from cocotb_tests.sense.test_fl_sample_scheduler import TB as SchedulerTb
from cocotb_tests.sense.test_fl_sense import TB as SenseTb
from cocotb_tests.timing.recorder import Recorder, compare, reader
from cocotb_tests.zcd import timer_bench, zcd_bench

PERIOD, SHORTER = 16, 12  # of the carrier, clocks
OFFSET = 3  # of the first sample, clocks


def field(chain: Chain, name: str) -> int:
    """A field of the chain's trace."""
    before = list(FIELDS)[: list(FIELDS).index(name)]
    return int(chain.dut.trace_o.value) >> sum(FIELDS[n] for n in before) & (1 << FIELDS[name]) - 1


def gates_text(gates: int) -> str:
    """Gates that are on: A+ the upper one, A- the lower one of leg A."""
    return " ".join(f"{'ABC'[k // 2]}{'+-'[k % 2]}" for k in range(6) if gates >> k & 1)


@cocotb.test
async def scheduled_commutation(dut: Any) -> None:
    """The gates change in the clock with now = t_c."""
    chain = Chain(dut)
    await chain.start(period=PERIOD, commutation=CSC, duty_q8=PERIOD - 4 << 8)
    await chain.align(PERIOD)
    drive: Drive = {}
    instant = 8
    schedule(drive, chain.now, instant, 2, False)
    instant += chain.now
    lines: dict[str, Callable[[], int | str]] = {
        "now = t_c": lambda: int(field(chain, "now") == instant),
        "comm_valid_i": reader(dut.comm_valid_i),
        "new sector": lambda: field(chain, "comm_applied"),
        "sector": lambda: field(chain, "sector") + 1,
        "count_o": lambda: field(chain, "count"),
        "gates": lambda: gates_text(field(chain, "gate")),
    }
    recorder = Recorder(dut.clk_i, lines, numbers=("sector", "count_o", "gates"))
    await chain.run(14, drive)
    gates = recorder.values["gates"]
    valid = recorder.values["comm_valid_i"].index(1)
    change = next(k for k in range(valid, len(gates)) if gates[k] != gates[valid])
    assert change - valid == COMM_TO_GATE
    assert change - recorder.values["new sector"].index(1) == COMM_TO_GATE - 1
    assert change == recorder.values["now = t_c"].index(1)
    compare("scheduled-commutation", recorder.diagram("CSC: the gates change at the scheduled instant t_c"))


@cocotb.test
async def carrier_settings(dut: Any) -> None:
    chain = Chain(dut)
    await chain.start(period=PERIOD, commutation=CSC, duty_q8=10 << 8)
    await chain.align(PERIOD)
    lines = {
        "update_i": reader(dut.update_i),
        "carrier_start_o": lambda: field(chain, "start"),
        "pulse_o": lambda: field(chain, "pulse"),
        "count_o": lambda: field(chain, "count"),
    }
    recorder = Recorder(dut.clk_i, lines, numbers=("count_o",))
    lead = PERIOD - UPDATE_TO_CARRIER
    drive: Drive = {lead: {"cfg_period_i": SHORTER, "cfg_duty_q8_i": 4 << 8}}
    pulse(drive, [lead], "update_i")
    await chain.run(PERIOD + SHORTER + 2, drive)
    starts = [k for k, high in enumerate(recorder.values["carrier_start_o"]) if high]
    recorder.takes(UPDATE_TO_CARRIER, "update_i", "carrier_start_o")
    assert starts[-1] - starts[-2] == SHORTER
    compare("carrier-settings", recorder.diagram(f"Period {PERIOD} to {SHORTER}, duty 10 to 4 clocks"))


@cocotb.test
async def sample_strobe(dut: Any) -> None:
    tb = SchedulerTb(dut)
    await tb.start(ONCE, PERIOD, OFFSET)
    await tb.run(2 * PERIOD, set())
    lines = {name: reader(getattr(dut, name)) for name in ("carrier_start_i", "strobe_o")}
    recorder = Recorder(dut.clk_i, lines)
    await tb.run(12, {tb.clock + 3})
    recorder.takes(START_TO_STROBE + OFFSET, "carrier_start_i", "strobe_o")
    compare("sample-strobe", recorder.diagram(f"Offset {OFFSET} clocks"))


@cocotb.test
async def sample_set(dut: Any) -> None:
    tb = SenseTb(dut)
    await tb.start()
    await tb.strobe()
    await tb.clocks(2)
    names = ("adc_valid_i", "current_valid_o", "sample_valid_o")
    recorder = Recorder(dut.clk_i, {name: reader(getattr(dut, name)) for name in names})
    await tb.clocks(1)
    await tb.valid([0x800] * tb.channels)
    await tb.clocks(tb.latency + 2)
    recorder.takes(tb.current_latency, "adc_valid_i", "current_valid_o")
    recorder.takes(tb.latency, "adc_valid_i", "sample_valid_o")
    compare("sample-set", recorder.diagram(f"Sample set of {tb.channels} channels"))


async def cross(dut: Any, method: int) -> Recorder:
    """Two samples that count, one before and one after the zero crossing of a rising sector."""
    tb = zcd_bench.TB(dut)
    await tb.start(zcd_bench.Settings(method=method, need_previous=0))
    vdc = 100_000
    before = zcd_bench.Sample(1000, vdc // 2 - 600, vdc, True, 1, 500, 500)
    await tb.commutate()
    await tb.sample(before)
    lines = {name: reader(getattr(dut, name)) for name in ("sample_valid_i", "zc_valid_o")}
    recorder = Recorder(dut.clk_i, lines)
    await tb.clocks(1)
    await tb.sample(replace(before, time=1050, value=vdc // 2 + 400, age=550, comm_age=550))
    return recorder


@cocotb.test
async def crossing_first(dut: Any) -> None:
    recorder = await cross(dut, zcd_bench.FIRST)
    recorder.takes(zcd_bench.DIRECT_LATENCY, "sample_valid_i", "zc_valid_o")
    compare("crossing-first", recorder.diagram("Zero crossing at a sample"))


@cocotb.test
async def crossing_interpolated(dut: Any) -> None:
    recorder = await cross(dut, zcd_bench.INTERPOLATED)
    recorder.takes(zcd_bench.INTERPOLATED_LATENCY, "sample_valid_i", "zc_valid_o")
    compare("crossing-interpolated", recorder.diagram("Interpolated zero crossing"))


@cocotb.test
async def earliest_commutation(dut: Any) -> None:
    tb = timer_bench.TB(dut)
    await tb.start(timer_bench.Settings(delay_q16=0))
    await tb.clocks(50)
    names = ("zc_valid_i", "comm_valid_o", "overdue_o")
    lines = {name: reader(getattr(dut, name)) for name in names}
    lines["sector"] = lambda: int(dut.sector_o.value) + 1
    recorder = Recorder(dut.clk_i, lines, numbers=("sector",))
    await tb.clocks(1)
    await tb.crossing(tb.now() - 20)
    await tb.clocks(timer_bench.CROSSING_LATENCY + 3)
    recorder.takes(timer_bench.CROSSING_LATENCY, "zc_valid_i", "comm_valid_o")
    compare("earliest-commutation", recorder.diagram("Commutation due at once"))
