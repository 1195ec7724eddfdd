# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Traces of the paths that turn gates off, of the dead time, and of the brake chopper."""

from __future__ import annotations

from typing import Any

import cocotb

from cocotb_tests.safety.test_fl_brake import CODE_TO_SWITCH, OFF, ON
from cocotb_tests.safety.test_fl_brake import TB as BrakeTb
from cocotb_tests.safety.test_fl_gate_guard import RESET_WAIT, GuardTb
from cocotb_tests.safety.test_fl_trip import CODE_TO_OFF, MIDDLE, PIN_TO_OFF, PULSE_TO_OFF, TripTb
from cocotb_tests.soc.test_fl_safety_wb import FEED, PERIOD_TO_OFF, WATCHDOG
from cocotb_tests.soc.test_fl_safety_wb import TB as SafetyTb
from cocotb_tests.timing.recorder import Recorder, compare, reader

DEAD_TIME = 4
PERIOD = 6  # of the watchdog, clocks


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


def trips(tb: TripTb, cause: str) -> Recorder:
    """Record what trips, and the gates."""
    lines = {name: reader(getattr(tb.dut, name)) for name in (cause, "trip_o")}
    lines["gates on"] = lambda: tb.gates().bit_count()
    return Recorder(tb.dut.clk_i, lines, numbers=("gates on",))


@cocotb.test
async def over_current(dut: Any) -> None:
    tb = TripTb(dut)
    await tb.start()
    recorder = trips(tb, "adc_valid_i")
    await tb.clocks(1)
    await tb.sample()
    await tb.clocks(3)
    second = len(recorder.values["adc_valid_i"])
    await tb.sample(c3=MIDDLE + 1001)
    await tb.clocks(5)
    recorder.takes(CODE_TO_OFF, "adc_valid_i", "gates on", second, to=0)
    compare("over-current", recorder.diagram("Second sample set: phase current over its limit"))


@cocotb.test
async def fault_pin(dut: Any) -> None:
    tb = TripTb(dut)
    await tb.start()
    await tb.sample()
    recorder = trips(tb, "fault_pin_i")
    await tb.clocks(2)
    dut.fault_pin_i.value = 1
    await tb.clocks(PIN_TO_OFF + 3)
    recorder.takes(PIN_TO_OFF, "fault_pin_i", "gates on", to=0)
    compare("fault-pin", recorder.diagram("The fault pin rises"))


@cocotb.test
async def software_trip(dut: Any) -> None:
    tb = TripTb(dut)
    await tb.start()
    await tb.sample()
    recorder = trips(tb, "software_i")
    await tb.clocks(2)
    await tb.pulse("software_i")
    await tb.clocks(4)
    recorder.takes(PULSE_TO_OFF, "software_i", "gates on", to=0)
    compare("software-trip", recorder.diagram("Software trip"))


@cocotb.test
async def watchdog(dut: Any) -> None:
    """The period begins with the clock after the write: there the number is in its register."""
    tb = SafetyTb(dut)
    await tb.begin(period=5000)
    await tb.write(FEED, 1)
    await tb.enable()
    await tb.clocks(RESET_WAIT + 100)
    assert tb.on() == 3, "the guard does not conduct"
    await tb.write(FEED, 2)
    await tb.write(WATCHDOG, PERIOD)
    lines = {"number is written": reader(dut.stb_i), "gates on": lambda: tb.on().bit_count()}
    recorder = Recorder(dut.clk_i, lines, numbers=("gates on",))
    await tb.clocks(1)
    await tb.write(FEED, 3)
    await tb.clocks(PERIOD + PERIOD_TO_OFF + 4)
    recorder.takes(1 + PERIOD + PERIOD_TO_OFF, "number is written", "gates on", to=0)
    compare("watchdog", recorder.diagram(f"Watchdog, period {PERIOD} clocks"))


@cocotb.test
async def brake(dut: Any) -> None:
    tb = BrakeTb(dut)
    await tb.begin(longest=tb.endless, age=100)
    dut.enable_i.value = 1
    dut.vdc_i.value = OFF - 10
    lines = {"adc_valid_i": reader(dut.adc_valid_i), "vdc_i": reader(dut.vdc_i), "brake_o": reader(dut.brake_o)}
    recorder = Recorder(dut.clk_i, lines, numbers=("vdc_i",))
    for code in (OFF - 10, ON + 10, OFF - 10):
        await tb.clocks(2)
        dut.vdc_i.value = code
        dut.adc_valid_i.value = 1
        await tb.clocks(1)
        dut.adc_valid_i.value = 0
    await tb.clocks(3)
    second = recorder.values["adc_valid_i"].index(1) + 1
    recorder.takes(CODE_TO_SWITCH, "adc_valid_i", "brake_o", second)
    compare("brake", recorder.diagram(f"Brake chopper: on above {ON}, off below {OFF}"))
