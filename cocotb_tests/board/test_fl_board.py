# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What all boards share: reset, guard of the clock, the way of faults to the gates, with a stand-in for the chip."""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any, NamedTuple

import cocotb
import pytest
from cocotb.clock import Clock
from cocotb.triggers import ClockCycles, FallingEdge, RisingEdge, Timer

from cocotb_tests.board.clocks import BEAT_CYCLES, BOARDS, limits
from cocotb_tests.board.serial_converter import SLOW, SerialConverters
from fluxlock.cosim.block import run_block_test

RESET_CYCLES = 90
GATES_ON = (1, 2)
FRAME_TO_OFF = 2  # clocks from a frame with a bad channel to the gates, published by the pages
CLEAR, EARLY = 1, 2  # commands of the stand-in
DEADLINE = 0x80  # a trip
CLOCK_NS, OSC_NS = 20, 26  # 50 MHz, and 38.5 MHz: the ULX3S has 38.75
# Of the ULX3S, published by the pages: clocks of the oscillator in a beat of the chip's clock, and the reverse.
LEAST = 41
MOST = 59
OSC_LEAST = 70
OSC_MOST = 99
STOP_TO_OFF = MOST + 3  # clocks of the oscillator from the last edge of the clock to the gates, published by the pages
OSC_STOP_TO_OFF = OSC_MOST + 3  # clocks from the oscillator's last edge to the gates

# States of a drive: what the stand-in's gates do, the brake switch, and whether it is enabled or trips then.
STATES = {
    "idle": (0, 0, "off"),
    "precharge": (1, 0, "on"),
    "align": (2, 0, "on"),
    "six-step": (3, 0, "on"),
    "vector": (4, 0, "on"),
    "braking": (5, 1, "on"),
    "fault": (0, 0, "tripped"),
    "fault, shorted": (6, 1, "tripped"),
}


def gates(dut: Any) -> tuple[int, int]:
    """Upper and lower gates that are on, by the pins in the polarity of the build."""
    pins = int(dut.gate_h_o.value), int(dut.gate_l_o.value)
    return pins[0] ^ 7 * int(dut.HighActiveLow.value), pins[1] ^ 7 * int(dut.LowActiveLow.value)


async def clocks_until(dut: Any, wanted: Any, limit: int) -> int:
    """Falling edges of the clock until `wanted()` holds."""
    for count in range(limit + 1):
        if wanted():
            return count
        await FallingEdge(dut.clk_i)
    raise AssertionError(f"not within {limit} clocks")


class Running(NamedTuple):
    """What drives the board."""

    clock: Clock
    osc: Clock
    converters: SerialConverters


def oscillate(pin: Any, period_ns: int) -> Clock:
    """A clock that runs from now on."""
    clock = Clock(pin, period_ns, unit="ns", period_high=period_ns // 2)
    clock.start()
    return clock


async def power_on(dut: Any, osc_ns: int = OSC_NS) -> tuple[Clock, Clock]:
    """Clock and oscillator run, nothing is good yet, no frame of a test before; return at a falling edge."""
    clocks = oscillate(dut.clk_i, CLOCK_NS), oscillate(dut.osc_i, osc_ns)
    for name in ("locked_i", "button_i", "fault_pin_i", "hall_i", "encoder_i", "uart_rx_i", "can_rx_i"):
        getattr(dut, name).value = 0
    dut.adc_sdata_i.value = 0x1FF
    await ClockCycles(dut.clk_i, 10)
    await FallingEdge(dut.clk_i)
    return clocks


async def run_up(dut: Any, osc_ns: int = OSC_NS) -> Running:
    """Reset over, converters answer, gates on."""
    clock, osc = await power_on(dut, osc_ns)
    dut.locked_i.value = 1
    converters = SerialConverters(dut, 9, SLOW, prefix="adc_")
    converters.codes = [2048] * 9
    await clocks_until(dut, lambda: dut.led_o.value[0] == 1, RESET_CYCLES + 5)
    await ClockCycles(dut.clk_i, 200)
    await enable(dut)
    return Running(clock, osc, converters)


async def enable(dut: Any) -> None:
    dut.hall_i.value = CLEAR
    await ClockCycles(dut.clk_i, 3)
    dut.hall_i.value = 0
    await clocks_until(dut, lambda: gates(dut) == GATES_ON, 1200)


@cocotb.test
async def holds_reset(dut: Any) -> None:
    await power_on(dut)
    limits_set = tuple(int(getattr(dut, name).value) for name in ("BeatLeast", "BeatMost", "OscLeast", "OscMost"))
    assert limits_set == (LEAST, MOST, OSC_LEAST, OSC_MOST) == limits(BOARDS[0])
    await ClockCycles(dut.clk_i, 3 * RESET_CYCLES)
    for cause, level in [("locked_i", 1), ("button_i", 0), ("locked_i", 1)]:
        name = getattr(dut, cause)
        name.value = 1 - level
        await ClockCycles(dut.clk_i, random.randrange(5, 300))
        await FallingEdge(dut.clk_i)
        assert dut.led_o.value[0] == 0 and gates(dut) == (0, 0) and dut.adc_cs_no.value == 1
        name.value = level
        # Two clocks of the synchroniser, the count, one clock each for release, reset register and permit of the pins.
        held = await clocks_until(dut, lambda: dut.led_o.value[0] == 1, RESET_CYCLES + 10)
        assert held == RESET_CYCLES + 4
        await ClockCycles(dut.clk_i, 10)
        assert dut.led_o.value[0] == 1


@cocotb.test
async def bad_channel_turns_the_gates_off(dut: Any) -> None:
    converters = (await run_up(dut)).converters
    assert int(dut.led_o.value) == 0b0001
    for channel in random.sample(range(9), 3):
        for level in (0, 1):
            await clocks_until(dut, lambda: dut.adc_cs_no.value == 0, 60)
            converters.stick({channel: level})
            await clocks_until(dut, lambda: dut.adc_cs_no.value == 1, 60)
            # Stuck high shows at the end of this frame, stuck low at that of the next.
            if level == 0:
                await clocks_until(dut, lambda: dut.adc_cs_no.value == 0, 60)
                await clocks_until(dut, lambda: dut.adc_cs_no.value == 1, 60)
            taken = await clocks_until(dut, lambda: gates(dut) == (0, 0), 20)
            assert taken == FRAME_TO_OFF, f"channel {channel} at {level}: gates off {taken} clocks after the frame"
            assert int(dut.led_o.value) == 0b0101
            converters.stick({})
            await ClockCycles(dut.clk_i, 130)
            assert gates(dut) == (0, 0), "gates came back without a command"
            await enable(dut)


@cocotb.test
async def missed_conversions_turn_the_gates_off(dut: Any) -> None:
    await run_up(dut)
    dut.hall_i.value = EARLY
    await clocks_until(dut, lambda: gates(dut) == (0, 0), 60)
    assert int(dut.led_o.value) == 0b1001
    dut.hall_i.value = 0
    await ClockCycles(dut.clk_i, 130)
    await enable(dut)


@cocotb.test
async def fault_pin_turns_the_gates_off(dut: Any) -> None:
    """Without a clock edge; the chip trips at the third one. The brake stays the chip's."""
    await run_up(dut)
    dut.encoder_i.value = 1
    await FallingEdge(dut.clk_i)
    dut.fault_pin_i.value = 1
    await Timer(1, "ns")
    assert gates(dut) == (0, 0) and dut.driver_enable_o.value == 0 and dut.brake_o.value == 1
    assert await clocks_until(dut, lambda: dut.u_soc.enable_q.value == 0, 10) == 3
    assert int(dut.led_o.value) == 0b0011


@cocotb.test
async def fault_pin_pulse_of_any_length_trips(dut: Any) -> None:
    """Gates go off with it and do not come back, wherever between two edges it was, though no edge has seen it."""
    await run_up(dut)
    for at_ns in range(1, CLOCK_NS, 3):
        await RisingEdge(dut.clk_i)
        await Timer(at_ns, "ns")
        dut.fault_pin_i.value = 1
        await Timer(1, "ns")
        dut.fault_pin_i.value = 0
        assert gates(dut) == (0, 0)
        for _ in range(1200):
            await Timer(5, "ns")
            assert gates(dut) == (0, 0), "gates came back without a command"
        assert dut.u_soc.trip.value == 1
        await FallingEdge(dut.clk_i)
        await enable(dut)


@cocotb.test
async def fault_pin_needs_no_clock(dut: Any) -> None:
    clock = (await run_up(dut)).clock
    clock.stop()
    await Timer(100, "ns")
    assert gates(dut) == GATES_ON
    dut.fault_pin_i.value = 1
    await Timer(1, "ns")
    assert gates(dut) == (0, 0)
    dut.fault_pin_i.value = 0
    await Timer(100, "ns")
    assert gates(dut) == (0, 0)


@cocotb.test
async def brake_pin_is_the_chips(dut: Any) -> None:
    """The stand-in's brake follows encoder input A."""
    await run_up(dut)
    for level in (1, 0, 1, 0):
        dut.encoder_i.value = level
        await ClockCycles(dut.clk_i, 2)
        assert int(dut.brake_o.value) == level


@cocotb.test
async def lost_lock_of_the_clock_needs_no_clock(dut: Any) -> None:
    """Gates and brake on, the clock stands still: they stay until the lock is lost, and are off at once then."""
    clock = (await run_up(dut)).clock
    dut.encoder_i.value = 1
    await ClockCycles(dut.clk_i, 2)
    clock.stop()
    await Timer(200, "ns")
    assert gates(dut) == GATES_ON and dut.brake_o.value == 1
    dut.locked_i.value = 0
    await Timer(1, "ns")
    assert gates(dut) == (0, 0) and dut.brake_o.value == 0


async def enter(dut: Any, state: str) -> None:
    """The chip in a state of the drive, for a while. No conversions: the converters' model wants a clock in order."""
    pattern, brake, what = STATES[state]
    dut.uart_rx_i.value = 1
    await ClockCycles(dut.clk_i, 60)
    if what == "off":
        await reset_by_button(dut)
    dut.encoder_i.value = (pattern & 3) << 1 | brake
    dut.hall_i.value = pattern & 4 | (CLEAR if what != "off" else 0)
    await ClockCycles(dut.clk_i, 3)
    dut.hall_i.value = pattern & 4
    await ClockCycles(dut.clk_i, 1100)  # the guard's wait after a reset
    if what == "tripped":
        dut.u_soc.u_trip.latched_q.value = DEADLINE
        await ClockCycles(dut.clk_i, 200)
    await ClockCycles(dut.clk_i, random.randrange(200))


def all_off(dut: Any) -> bool:
    """Gates and brake, by the pins."""
    return gates(dut) == (0, 0) and dut.brake_o.value == 0


async def stays_off(dut: Any, time_ns: int) -> None:
    """No gate, no brake and no edge of the drivers' enable for a time."""
    level = int(dut.driver_enable_o.value)
    for _ in range(time_ns // 13):
        await Timer(13, "ns")
        assert all_off(dut) and int(dut.driver_enable_o.value) == level


async def reset_by_button(dut: Any) -> None:
    dut.button_i.value = 1
    await ClockCycles(dut.clk_i, 10)
    dut.button_i.value = 0
    await clocks_until(dut, lambda: dut.led_o.value[0] == 1, RESET_CYCLES + 10)
    await ClockCycles(dut.clk_i, 200)


@cocotb.test
@cocotb.parametrize(state=list(STATES))
async def clock_stops_in_every_state(dut: Any, state: str) -> None:
    """Gates and brake are off in time wherever it stops; they stay off when it runs again, until a reset."""
    clock = (await run_up(dut)).clock
    used = STATES[state][2] == "on" or "short" in state
    for _ in range(3):
        await enter(dut, state)
        seen_on = 0
        for _ in range(60):
            await FallingEdge(dut.clk_i)
            seen_on += not all_off(dut)
        assert (seen_on > 0) == used
        await Timer(random.randrange(1, CLOCK_NS), "ns")
        clock.stop()
        await Timer(STOP_TO_OFF * OSC_NS, "ns")
        await stays_off(dut, 10_000)
        assert dut.led_o.value[0] == 0
        clock = oscillate(dut.clk_i, CLOCK_NS)
        await stays_off(dut, 5_000)
        dut.hall_i.value = CLEAR
        await stays_off(dut, 25_000)
        assert dut.u_soc.trip.value == 1, "the chip does not know"
        dut.hall_i.value = 0
        await reset_by_button(dut)
    await enter(dut, "precharge")
    assert gates(dut) == (0, 7)


@cocotb.test
@cocotb.parametrize(cause=["button_i", "locked_i"], state=["six-step", "vector", "fault, shorted"])
async def clock_stops_in_every_period_of_a_reset(dut: Any, cause: str, state: str) -> None:
    """Before the chip's reset the monitor finds it, from then on all is off at once: the monitors no longer watch."""
    clock = (await run_up(dut)).clock
    pin, active = getattr(dut, cause), int(cause == "button_i")
    in_reset = []
    for period in [*range(9), *random.sample(range(9, RESET_CYCLES - 10), 2)]:
        await enter(dut, state)
        while all_off(dut):
            await FallingEdge(dut.clk_i)
        await Timer(random.randrange(1, CLOCK_NS), "ns")
        pin.value = active
        await Timer(1, "ns")
        if cause == "locked_i":
            pin.value = 1 - active  # seen by no clock edge
        for _ in range(period):
            await RisingEdge(dut.clk_i)
        await Timer(random.randrange(1, CLOCK_NS), "ns")
        clock.stop()
        in_reset.append(dut.u_soc.rst_i.value == 1)
        if cause == "button_i" and not in_reset[-1]:
            await Timer(STOP_TO_OFF * OSC_NS, "ns")
        assert dut.driver_enable_o.value == 0, f"{period} edges after the cause"
        await stays_off(dut, 3_000)
        if random.randrange(2):
            pin.value = 1 - active
        await stays_off(dut, 3_000)
        assert dut.led_o.value[0] == 0
        clock = oscillate(dut.clk_i, CLOCK_NS)
        await stays_off(dut, CLOCK_NS * 5)
        dut.hall_i.value, dut.encoder_i.value = 0, 0
        await stays_off(dut, 3_000)
        pin.value = 1 - active
        await reset_by_button(dut)
    assert {False, True} == set(in_reset)


@cocotb.test
@cocotb.parametrize(period_ns=[2, 8, 10, 12, 32, 40, 100, 2000])
async def clock_too_fast_or_slow(dut: Any, period_ns: int) -> None:
    """31 MHz or less, 83 MHz or more: off within three beats of that clock or the time of a stop, until a reset."""
    clock = (await run_up(dut)).clock
    await enter(dut, "six-step")
    clock.stop()
    clock = oscillate(dut.clk_i, period_ns)
    limit_ns = max(STOP_TO_OFF * OSC_NS, 3 * BEAT_CYCLES * period_ns + 4 * OSC_NS) if period_ns < CLOCK_NS else (
        BEAT_CYCLES * CLOCK_NS + STOP_TO_OFF * OSC_NS
    )  # fmt: skip
    while dut.u_clk_monitor.bad_o.value == 0:
        await Timer(1, "ns")
        limit_ns -= 1
        assert limit_ns > 0
    await Timer(1, "ns")
    await stays_off(dut, 5_000)
    clock.stop()
    oscillate(dut.clk_i, CLOCK_NS)
    dut.hall_i.value = CLEAR
    await stays_off(dut, 20_000)
    dut.hall_i.value = 0
    await reset_by_button(dut)
    await enter(dut, "precharge")
    assert gates(dut) == (0, 7)


@cocotb.test
@cocotb.parametrize(osc_ns=[23, 26, 30])
async def good_clocks_change_nothing(dut: Any, osc_ns: int) -> None:
    """With the oscillator at both ends of its tolerance the pins are the chip's at every instant, in every state."""
    await run_up(dut, osc_ns)
    for state, (_, _, what) in STATES.items():
        await enter(dut, state)
        for _ in range(400):
            await Timer(7, "ns")
            assert (dut.gate_h_o.value, dut.gate_l_o.value) == (dut.gate_h.value, dut.gate_l.value)
            assert (dut.brake_o.value, dut.driver_enable_o.value) == (dut.brake.value, dut.driver_enable.value)
        assert (dut.u_soc.trip.value == 1) == (what == "tripped")


@cocotb.test
@cocotb.parametrize(osc_ns=[0, 4, 60, 1000])
async def oscillator_stops_or_is_wrong(dut: Any, osc_ns: int) -> None:
    """The chip's clock finds it: off in time and a trip by name, until a reset with a good oscillator."""
    osc = (await run_up(dut)).osc
    await enter(dut, "vector")
    osc.stop()
    if osc_ns:
        osc = oscillate(dut.osc_i, osc_ns)
    for _ in range(3 * OSC_STOP_TO_OFF if osc_ns else OSC_STOP_TO_OFF + 1):
        await FallingEdge(dut.clk_i)
    await stays_off(dut, 20_000)
    assert dut.u_soc.trip.value == 1 and dut.u_soc.clock_fault_i.value == 1
    if osc_ns:
        osc.stop()
    dut.button_i.value = 1
    await ClockCycles(dut.clk_i, 10)
    dut.button_i.value = 0
    dut.hall_i.value = CLEAR
    for _ in range(RESET_CYCLES + OSC_STOP_TO_OFF + 10):  # found anew, before the guard lets a gate on
        await FallingEdge(dut.clk_i)
        assert gates(dut) == (0, 0)
    await stays_off(dut, 40_000)
    assert dut.u_soc.clock_fault_i.value == 1, "a reset has made an oscillator good that stands"
    dut.hall_i.value = 0
    oscillate(dut.osc_i, OSC_NS)
    await reset_by_button(dut)
    await enter(dut, "precharge")
    assert gates(dut) == (0, 7)


@cocotb.test
@cocotb.parametrize(state=list(STATES))
async def lost_lock_resets_without_a_clock(dut: Any, state: str) -> None:
    """At once; the chip is reset before a gate can be on again, also if the loss ends while the clock stands."""
    clock = (await run_up(dut)).clock
    for stands in (False, True):
        await enter(dut, state)
        await Timer(random.randrange(1, CLOCK_NS), "ns")
        if stands:
            clock.stop()
        dut.locked_i.value = 0
        await Timer(1, "ns")
        assert all_off(dut) and dut.driver_enable_o.value == 0
        await Timer(2, "ns")
        dut.locked_i.value = 1
        await stays_off(dut, 200)
        if stands:
            clock = oscillate(dut.clk_i, CLOCK_NS)
        await stays_off(dut, CLOCK_NS * 5)
        assert dut.u_soc.rst_i.value == 1
        dut.hall_i.value, dut.encoder_i.value = 0, 0
        await stays_off(dut, CLOCK_NS * (RESET_CYCLES - 10))
        await clocks_until(dut, lambda: dut.led_o.value[0] == 1, 50)
        await stays_off(dut, 5_000)
        assert dut.u_soc.enable_q.value == 0


@cocotb.test
async def pll_is_reset_after_its_lock_is_lost(dut: Any) -> None:
    """Long enough for both vendors, and not longer; what follows is fl_pll_reset's own test."""
    await power_on(dut)
    dut.uart_rx_i.value = 1
    dut.locked_i.value = 1
    await Timer(((1 << 16) + 4) * OSC_NS, "ns")  # the pulse that configuration begins
    assert dut.pll_rst_o.value == 0
    dut.locked_i.value = 0
    await Timer(3 * OSC_NS, "ns")
    assert dut.pll_rst_o.value == 1
    await Timer((1 << 16) * OSC_NS, "ns")
    assert dut.pll_rst_o.value == 0
    dut.locked_i.value = 1
    await Timer(100 * OSC_NS, "ns")
    assert dut.pll_rst_o.value == 0


@cocotb.test
async def enable_toggles_while_the_gates_are_permitted(dut: Any) -> None:
    """An edge every 64 clocks; none in idle, after a trip, with a fault pin or with a clock that stands."""
    clock, _, converters = await run_up(dut)

    async def edges(time_ns: int) -> int:
        count, level = 0, dut.driver_enable_o.value
        for _ in range(time_ns // 10):
            await Timer(10, "ns")
            count += dut.driver_enable_o.value != level
            level = dut.driver_enable_o.value
        return count

    assert await edges(64 * 64 * CLOCK_NS) == 64
    converters.stick({3: 1})
    await ClockCycles(dut.clk_i, 200)
    assert await edges(10_000) == 0 and dut.driver_enable_o.value == 0
    converters.stick({})
    await ClockCycles(dut.clk_i, 130)
    await enable(dut)
    assert await edges(64 * 64 * CLOCK_NS) == 64
    clock.stop()
    await Timer(OSC_NS * STOP_TO_OFF, "ns")
    assert await edges(10_000) == 0


@pytest.mark.parametrize("polarity", [0, 1, 2])
def test_fl_board(polarity: int) -> None:
    """Reset; bad and missed conversions, fault pin to the gates; clocks that stop, also in a reset, or are wrong.

    Verifies: BRD-08, CLK-02, CLK-03, CLK-04, CLK-05, CLK-07
    """
    sources = [
        "common/fl_sync.sv",
        *(f"safety/fl_{name}.sv" for name in ("async_clear", "clock_monitor", "driver_enable")),
        "board/fl_pll_reset.sv",
        "safety/fl_trip.sv",
        "safety/fl_gate_guard.sv",
        Path(__file__).with_name("fl_soc_stand_in.sv"),
        "board/fl_adc_serial.sv",
        "board/fl_adc_fault.sv",
        "board/fl_board.sv",
    ]
    parameters = {"ResetCycles": RESET_CYCLES, "HighActiveLow": polarity & 1, "LowActiveLow": polarity >> 1}
    seen = ["fl_soc", "fl_trip", "fl_clock_monitor"]
    run_block_test("fl_board", sources, __name__, parameters=parameters, seen=seen)
