# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What all boards share: reset, and the way of converter faults to the gates, with a stand-in for the chip."""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any

import cocotb
import pytest
from cocotb.clock import Clock
from cocotb.triggers import ClockCycles, FallingEdge, Timer

from cocotb_tests.board.serial_converter import SLOW, SerialConverters
from fluxlock.cosim.block import run_block_test

RESET_CYCLES = 90
GATES_ON = (1, 2)
FRAME_TO_OFF = 2  # clocks from a frame with a bad channel to the gates, published by the pages
CLEAR, EARLY = 1, 2  # commands of the stand-in


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


async def power_on(dut: Any) -> Clock:
    """Clock runs, nothing is good yet, no frame of a test before; return at a falling edge."""
    clock = Clock(dut.clk_i, 20, unit="ns")
    clock.start()
    for name in ("locked_i", "button_i", "fault_pin_i", "hall_i", "encoder_i", "uart_rx_i", "can_rx_i"):
        getattr(dut, name).value = 0
    dut.adc_sdata_i.value = 0x1FF
    await ClockCycles(dut.clk_i, 10)
    await FallingEdge(dut.clk_i)
    return clock


async def run_up(dut: Any) -> tuple[Clock, SerialConverters]:
    """Reset over, converters answer, gates on."""
    clock = await power_on(dut)
    dut.locked_i.value = 1
    converters = SerialConverters(dut, 9, SLOW, prefix="adc_")
    converters.codes = [2048] * 9
    await clocks_until(dut, lambda: dut.led_o.value[0] == 1, RESET_CYCLES + 5)
    await ClockCycles(dut.clk_i, 200)
    await enable(dut)
    return clock, converters


async def enable(dut: Any) -> None:
    dut.hall_i.value = CLEAR
    await ClockCycles(dut.clk_i, 3)
    dut.hall_i.value = 0
    await clocks_until(dut, lambda: gates(dut) == GATES_ON, 1200)


@cocotb.test
async def holds_reset(dut: Any) -> None:
    await power_on(dut)
    await ClockCycles(dut.clk_i, 3 * RESET_CYCLES)
    for cause, level in [("locked_i", 1), ("button_i", 0), ("locked_i", 1)]:
        name = getattr(dut, cause)
        name.value = 1 - level
        await ClockCycles(dut.clk_i, random.randrange(5, 300))
        await FallingEdge(dut.clk_i)
        assert dut.led_o.value[0] == 0 and gates(dut) == (0, 0) and dut.adc_cs_no.value == 1
        name.value = level
        # Two clocks of the synchroniser, the count, one clock each for the release and the reset register.
        held = await clocks_until(dut, lambda: dut.led_o.value[0] == 1, RESET_CYCLES + 10)
        assert held == RESET_CYCLES + 3
        await ClockCycles(dut.clk_i, 10)
        assert dut.led_o.value[0] == 1


@cocotb.test
async def bad_channel_turns_the_gates_off(dut: Any) -> None:
    _, converters = await run_up(dut)
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
    await run_up(dut)
    await FallingEdge(dut.clk_i)
    dut.fault_pin_i.value = 1
    assert await clocks_until(dut, lambda: gates(dut) == (0, 0), 10) == 3
    assert int(dut.led_o.value) == 0b0011


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
    clock, _ = await run_up(dut)
    dut.encoder_i.value = 1
    await ClockCycles(dut.clk_i, 2)
    clock.stop()
    await Timer(200, "ns")
    assert gates(dut) == GATES_ON and dut.brake_o.value == 1
    dut.locked_i.value = 0
    await Timer(1, "ns")
    assert gates(dut) == (0, 0) and dut.brake_o.value == 0


@pytest.mark.parametrize("polarity", [0, 1, 2])
def test_fl_board(polarity: int) -> None:
    """Reset times; bad and missed conversions and the fault pin to the gates.

    Verifies: BRD-08
    """
    sources = [
        "safety/fl_sync.sv",
        "safety/fl_trip.sv",
        "safety/fl_gate_guard.sv",
        Path(__file__).with_name("fl_soc_stand_in.sv"),
        "board/fl_adc_serial.sv",
        "board/fl_adc_fault.sv",
        "board/fl_board.sv",
    ]
    parameters = {"ResetCycles": RESET_CYCLES, "HighActiveLow": polarity & 1, "LowActiveLow": polarity >> 1}
    run_block_test("fl_board", sources, __name__, parameters=parameters)
