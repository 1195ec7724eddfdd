# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Test bench of the PWM chain: stimuli by clock number, a recorded trace, and checks on recorded levels."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, ReadOnly, Timer
from numpy.typing import NDArray

from fluxlock.base.paths import ROOT

Dut: TypeAlias = Any  # handles are found by name at run time

RSC, NSC, CSC = range(3)
OFF, MANUAL, SIX_STEP = range(3)
ON_PWM, H_PWM_L_ON, PWM_ON, H_ON_L_PWM = range(4)
COMM_TO_GATE = 2  # clocks from comm_valid_i to the gate pins

SOURCES: list[str | Path] = [
    "pwm/fl_carrier.sv",
    "pwm/fl_sequencer.sv",
    "pwm/fl_pwm_state.sv",
    "safety/fl_gate_guard.sv",
    ROOT / "cocotb_tests" / "pwm" / "fl_pwm_chain.sv",
]

# Fields of trace_o from bit 0 on.
FIELDS = {
    "pulse": 1,
    "start": 1,
    "count": 16,
    "apply": 1,
    "comm_applied": 1,
    "sector": 3,
    "active": 1,
    "req_h": 3,
    "req_l": 3,
    "gate": 6,
    "comm_age": 16,
    "age": 16,
    "state_sector": 3,
    "on": 1,
    "dropped": 16,
    "leg_cmd": 9,
    "now": 32,
    "last_length": 17,  # of the carrier before, from the second clock of a carrier on
    "last_on": 17,
}

Levels = NDArray[np.int64]
Drive = dict[int, dict[str, int]]


@dataclass(frozen=True)
class Trace:
    """One array a signal, one element a clock; element 0 is the first clock of the run."""

    data: Mapping[str, Levels]

    def __getattr__(self, name: str) -> Levels:
        return self.data[name]

    def __len__(self) -> int:
        return len(self.data["now"])

    def switch(self, x: int, upper: bool) -> Levels:
        """Request of one switch."""
        return (self.data["req_h" if upper else "req_l"] >> x) & 1


def add(drive: Drive, cycle: int, **signals: int) -> None:
    """Set signals from `cycle` of the next run on."""
    drive.setdefault(cycle, {}).update(signals)


def pulse(drive: Drive, cycles: Iterable[int], name: str) -> None:
    """One-clock pulses of an input."""
    cycles = sorted(cycles)
    for cycle in cycles:
        add(drive, cycle, **{name: 1})
        if cycle + 1 not in cycles:
            add(drive, cycle + 1, **{name: 0})


def schedule(drive: Drive, base: int, instant: int, known: int, late_fall: bool) -> None:
    """One commutation as the timer announces it: known ahead, comm_valid_i in time for the gates."""
    fire = instant - COMM_TO_GATE
    add(drive, known, sched_valid_i=1, comm_sched_i=(base + instant) & 0xFFFF_FFFF)
    pulse(drive, [fire], "comm_valid_i")
    add(drive, fire + 1 if late_fall else fire, sched_valid_i=0)


class Chain:
    """Clock, reset, settings and recording of fl_pwm_chain."""

    def __init__(self, dut: Dut) -> None:
        self.dut = dut
        self.now = 0  # time stamp of the first clock of the next run

    async def start(self, **settings: int) -> None:
        """Reset, then apply settings with an update; guard enabled."""
        inputs = {
            "update_i": 0, "comm_valid_i": 0, "sched_valid_i": 0, "comm_sched_i": 0, "trip_i": 0,
            "enable_i": 1, "dead_time_i": 2, "cfg_commutation_i": CSC, "cfg_period_i": 100,
            "cfg_duty_q8_i": 0, "cfg_min_pulse_i": 0,
            "cfg_mode_i": SIX_STEP, "cfg_pattern_i": ON_PWM, "cfg_sync_rect_i": 0,
            "cfg_start_hall_i": 0, "hall_position_i": 0, "hall_ok_i": 0, "load_i": 0, "load_sector_i": 0,
            "cfg_reverse_i": 0, "cfg_start_sector_i": 0, "cfg_manual_i": 0, "rst_i": 1,
        }  # fmt: skip
        for name, value in inputs.items():
            getattr(self.dut, name).value = value
        Clock(self.dut.clk_i, 20, "ns").start()
        for _ in range(3):
            await FallingEdge(self.dut.clk_i)
        self.dut.rst_i.value = 0
        self.now = 0
        await self.update(**settings)
        # The reset guard waits for the longest dead time, and the first carrier is 65535 clocks long: a
        # commutation under CSC restarts it, and five more lead back to the start sector.
        commutation = settings.get("commutation", CSC)
        await self.update(commutation=CSC)
        drive: Drive = {}
        pulse(drive, [8 + 20 * i for i in range(6)], "comm_valid_i")
        await self.run(1100, drive)
        await self.update(commutation=commutation)
        await self.run(2 * settings.get("period", 100), {})

    async def update(self, **settings: int) -> None:
        """Set cfg_* ports and pulse update_i for one clock."""
        drive: Drive = {0: {f"cfg_{k}_i": v for k, v in settings.items()}}
        pulse(drive, [0], "update_i")
        await self.run(2, drive)

    async def skip(self, cycles: int) -> None:
        """Let clocks pass without a record."""
        if cycles:
            await Timer(20 * cycles - 10, "ns")
            await FallingEdge(self.dut.clk_i)
            self.now += cycles

    async def align(self, period: int) -> None:
        """Run to just before the first clock of a carrier, so that element 0 of the next run is that clock."""
        trace = await self.run(1, {})
        while not trace.start[0]:
            trace = await self.run(1, {})
        await self.run(period - 1, {})

    async def run(self, cycles: int, drive: Drive) -> Trace:
        """Run a number of clocks; inputs change at the falling edge, the record is of just after that.

        Element i holds the registers after i rising edges of this run and the inputs of edge i + 1.
        """
        words: list[int] = []
        for i in range(cycles):
            for name, value in drive.get(i, {}).items():
                getattr(self.dut, name).value = value
            if not i or i in drive:  # otherwise nothing has changed since the rising edge
                await ReadOnly()
            words.append(int(self.dut.trace_o.value))
            await FallingEdge(self.dut.clk_i)
        for signals in (v for k, v in sorted(drive.items()) if k >= cycles):
            for name, value in signals.items():
                getattr(self.dut, name).value = value
        self.now += cycles
        data: dict[str, Levels] = {}
        shift = 0
        for name, width in FIELDS.items():
            mask = (1 << width) - 1
            data[name] = np.array([(w >> shift) & mask for w in words], dtype=np.int64)
            shift += width
        return Trace(data)


def runs(level: Levels) -> list[tuple[int, int, int]]:
    """(value, first clock, length) of every stretch of equal level but the first and the last."""
    edges = np.flatnonzero(np.diff(level)) + 1
    return [(int(level[a]), int(a), int(b - a)) for a, b in pairwise(edges)]


def carriers(trace: Trace) -> list[tuple[int, int, int]]:
    """(first clock, length, clocks with the pulse on) of every whole carrier."""
    first = np.flatnonzero(trace.start)
    total = np.concatenate([[0], np.cumsum(trace.pulse)])
    return [(int(a), int(b - a), int(total[b] - total[a])) for a, b in pairwise(first)]
