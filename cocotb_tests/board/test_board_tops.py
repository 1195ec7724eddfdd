# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Board tops with models of the vendors' clock primitives: oscillator, PLL and its reset reach the gates' guard."""

from __future__ import annotations

import math
import random
from pathlib import Path
from typing import Any

import cocotb
import pytest
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, Timer

from cocotb_tests.board.clocks import BOARDS, BoardClocks, limits
from fluxlock.cosim.block import run_block_test

CLOCK_NS = 20
CLEAR, PRECHARGE = 1, 2  # commands of the stand-in, Hall and encoder inputs
LOWER_GATES = 7


def board_of(dut: Any) -> BoardClocks:
    return next(board for board in BOARDS if board.top == dut._name)


def oscillator(dut: Any) -> Any:
    """The level that the on-chip oscillator's model shows."""
    return dut.u_osc.clock if dut._name == "fl_board_ulx3s" else dut.u_startup.clock


def start(pin: Any, period_ns: int) -> Clock:
    clock = Clock(pin, period_ns, unit="ns", period_high=period_ns // 2)
    clock.start()
    return clock


def off(dut: Any) -> bool:
    return not (int(dut.gate_h_o.value) | int(dut.gate_l_o.value) | int(dut.brake_o.value))


async def gates_on(dut: Any) -> None:
    """The chip out of reset, all lower gates on."""
    while dut.led_o.value[0] == 0:
        await Timer(1, "us")
    await Timer(25, "us")
    dut.hall_i.value = CLEAR
    await Timer(100, "ns")
    dut.hall_i.value = 0
    await Timer(2, "us")
    assert int(dut.gate_l_o.value) == LOWER_GATES


@cocotb.test(timeout_time=20, timeout_unit="ms")
async def clock_stops_and_lock_is_lost(dut: Any) -> None:
    """Off in the board's own time at the oscillator's slowest; on again after the button; off and reset by the lock."""
    board = board_of(dut)
    slowest_ns = math.floor(1e9 / (board.osc_hz * (1 - board.tolerance)))
    arty = board.top == "fl_board_arty"
    button, pressed = (dut.reset_button_ni, 0) if arty else (dut.reset_button_i, 1)
    dut.fault_pin_i.value, dut.hall_i.value, dut.encoder_i.value = 0, 0, PRECHARGE
    dut.uart_rx_i.value, dut.can_rx_i.value = 1, 1
    button.value, dut.u_pll.lock.value = 1 - pressed, 1
    dut.adc_sdata_i.value = 0
    clock = start(dut.u_pll.clock, CLOCK_NS)
    start(oscillator(dut), slowest_ns)
    await gates_on(dut)
    await Timer(random.randrange(1, CLOCK_NS), "ns")
    clock.stop()
    await Timer((limits(board)[1] + 3) * slowest_ns, "ns")
    assert off(dut)
    start(dut.u_pll.clock, CLOCK_NS)
    dut.hall_i.value = CLEAR
    await Timer(30, "us")
    assert off(dut)
    dut.hall_i.value = 0
    button.value = pressed
    await Timer(1, "us")
    button.value = 1 - pressed
    await gates_on(dut)

    dut.u_pll.lock.value = 0
    await Timer(1, "ns")
    assert off(dut)
    await Timer(3 * slowest_ns, "ns")
    assert dut.u_pll.RST.value == 1, "the PLL has no reset"
    dut.u_pll.lock.value = 1
    await FallingEdge(dut.u_pll.RST)
    assert off(dut) and dut.led_o.value[0] == 0
    await Timer(1, "ms")
    assert off(dut)
    await gates_on(dut)


@pytest.mark.parametrize("top", [board.top for board in BOARDS])
def test_board_tops(top: str) -> None:
    """Clock stopped, lock lost, button, at the slowest oscillator.

    Verifies: CLK-02, CLK-05
    """
    here = Path(__file__).parent
    sources = [
        "common/fl_sync.sv",
        *(f"safety/fl_{name}.sv" for name in ("async_clear", "clock_monitor", "driver_enable")),
        *("safety/fl_trip.sv", "safety/fl_gate_guard.sv", "board/fl_pll_reset.sv"),
        *("board/fl_adc_serial.sv", "board/fl_adc_fault.sv", "board/fl_board.sv", f"board/{top}.sv"),
        *(here / "fl_soc_stand_in.sv", here / "vendor_models.sv"),
    ]
    run_block_test(top, sources, __name__, seen=["EHXPLLL", "OSCG", "PLLE2_BASE", "STARTUPE2"])
