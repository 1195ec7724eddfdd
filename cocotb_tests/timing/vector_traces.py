# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Traces of the vector path, of the leg carriers, and of tick and update event."""

from __future__ import annotations

from typing import Any

import cocotb

from cocotb_tests.foc.foc_bench import Regulator
from cocotb_tests.foc.test_fl_foc_wb import CARRIER, CODES_TO_COMPARES, MEAN_MORE, ONCE
from cocotb_tests.foc.test_fl_foc_wb import TB as VectorTb
from cocotb_tests.foc.test_fl_modulator import Settings
from cocotb_tests.pwm.chain import Drive
from cocotb_tests.pwm.test_fl_leg_carrier import TB as LegTb
from cocotb_tests.pwm.test_fl_leg_carrier import VALID_TO_UPDATE, Handed
from cocotb_tests.soc.bench import Bench
from cocotb_tests.soc.test_fl_timer import SYNC_TO_TICK, TICK_PERIOD, TICK_SAMPLES, TICK_TO_UPDATE, UPDATE
from cocotb_tests.timing.recorder import Recorder, compare, reader

TICK = 12
PERIOD = 20  # of a leg carrier, clocks
STEP = 320  # between two regulator steps, clocks
# Of the samples, clocks; a carrier's first one comes as late, so that none before is in its way.
SPACING = 80


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


@cocotb.test
async def tick_by_samples(dut: Any) -> None:
    bench = Bench(dut)
    await bench.start(sync_i=0)
    await bench.write(TICK_SAMPLES, 2)
    await bench.clocks(2)
    lines = {name: reader(getattr(dut, name)) for name in ("sync_i", "tick_o")}
    recorder = Recorder(dut.clk_i, lines)
    for _ in range(2):
        await bench.clocks(2)
        dut.sync_i.value = 1
        await bench.clocks(1)
        dut.sync_i.value = 0
    await bench.clocks(4)
    second = recorder.values["sync_i"].index(1) + 1
    recorder.takes(SYNC_TO_TICK, "sync_i", "tick_o", second)
    compare("tick-by-samples", recorder.diagram("Tick at every second step"))


@cocotb.test
async def leg_compares(dut: Any) -> None:
    tb = LegTb(dut)
    await tb.start(cfg_period_i=PERIOD)
    await tb.to_start()
    drive: Drive = {}
    for clock, compare_clocks in ((1, 6), (2 * PERIOD - VALID_TO_UPDATE, 14)):
        tb.hand_over(drive, Handed(clock, PERIOD, (compare_clocks,) * tb.phases))
    await tb.run(PERIOD, drive)
    lines = {"compare_valid_i": reader(dut.compare_valid_i), "update_o": reader(dut.update_o)}
    lines["req_h_o[0]"] = reader(dut.req_h_o, 1)
    recorder = Recorder(dut.clk_i, lines)
    await tb.run(2 * PERIOD, {clock - PERIOD: ports for clock, ports in drive.items() if clock >= PERIOD})
    recorder.takes(VALID_TO_UPDATE, "compare_valid_i", "update_o")
    assert sum(map(int, recorder.values["req_h_o[0]"])) == 6 + 14, "the update did not take the compares"
    compare("leg-compares", recorder.diagram("Compares in time for the next update: 6, then 14 clocks"))


async def step(tb: VectorTb, start: int, length: int) -> Recorder:
    """From one update of the leg carriers to the next; start, length: of the current window, 0: one sample."""
    await tb.modulator(Settings(period=STEP))
    await tb.regulators([Regulator() for _ in range(tb.subspaces)])
    await tb.window(start, length, start)
    await tb.control(source=1, enable=1, bypass=1)
    await tb.settle()
    await tb.write("timer.tick_samples", 1)
    await tb.tick()
    await tb.tick()
    while not int(tb.dut.update_o.value):
        await tb.clocks(1)
    names = ("update_o", "adc_valid_i", "sync_o", "tick_o")
    recorder = Recorder(tb.dut.clk_i, {name: reader(getattr(tb.dut, name)) for name in names})
    await tb.clocks(STEP + 3)
    recorder.takes(SYNC_TO_TICK, "sync_o", "tick_o")
    return recorder


@cocotb.test
async def vector_step(dut: Any) -> None:
    """sync_o: the compares are made; they are in the shadow registers one clock later."""
    tb = VectorTb(dut)
    await tb.start(cfg_mode_i=ONCE, cfg_offset_i=0)
    recorder = await step(tb, 0, 0)
    recorder.takes(CODES_TO_COMPARES[tb.phases] - 1, "adc_valid_i", "sync_o")
    compare("vector-step", recorder.diagram("Regulator step of one sample, three phases"))


@cocotb.test
async def vector_mean(dut: Any) -> None:
    """The window takes the second and third sample; the last one strobes before the next window."""
    tb = VectorTb(dut)
    await tb.start(cfg_mode_i=CARRIER, cfg_spacing_i=SPACING, cfg_offset_i=SPACING)
    recorder = await step(tb, SPACING, SPACING + 1)
    last = 2 * SPACING + 1 + tb.conversion  # the second sample of the window
    recorder.takes(CODES_TO_COMPARES[tb.phases] + MEAN_MORE - 1, "adc_valid_i", "sync_o", last)
    compare("vector-mean", recorder.diagram("Regulator step of the mean of the second and third sample"))
