# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Model of serial converters of the AD7276 class at their pins, with the figures of the part's timing table.

It knows nothing of the controller: it watches chip select and clock as they arrive at the part, checks them against the
table, and drives the data lines: right from the latest to the earliest instant that the table allows, random outside.
The lines between controller and part, the level shifter and the input of the FPGA are delays on both ways.
"""

from __future__ import annotations

import random
from dataclasses import dataclass
from typing import Any

import cocotb
from cocotb.triggers import First, Timer, ValueChange
from cocotb.utils import get_sim_time


@dataclass(frozen=True)
class TimingTable:
    """Class figures, ns, worst case over supply and temperature: check them against the datasheet of the part."""

    quiet: float = 4.0  # tQUIET: bus released to the next select, least
    select_high: float = 3.0  # t1: least
    select_to_clock: float = 6.0  # t2: select to the first falling edge, least
    enable: float = 4.0  # t3: select to the first zero, most
    access: float = 15.0  # t4: falling edge to the next bit, most
    low_fraction: float = 0.4  # t5, t6: of the clock's period, low and high, least
    hold: float = 5.0  # t7: falling edge to the end of the old bit, least
    clock_release: float = 14.0  # t8: 16th falling edge to three-state, most
    select_release: float = 4.2  # t9: select high to three-state, most
    acquire: float = 60.0  # 13th rising edge to the next hold, least
    clock_min_hz: float = 500e3
    clock_max_hz: float = 48e6


@dataclass(frozen=True)
class Paths:
    """Delays between the flip-flops of the FPGA and the part, ns, as the constraints of the boards allow them."""

    out: float = 10.0  # clock edge to cs_no and sclk_o at the pad
    skew: float = 1.0  # cs_no may be later than sclk_o by this
    back: float = 7.0  # level shifter and board, both ways
    into: float = 7.0  # pad to flip-flop, less than one nanosecond before its clock edge
    pull_up: float = 170.0  # time in which a released line has risen


SLOW = Paths()
FAST = Paths(out=1.0, skew=0.0, back=0.0, into=0.0, pull_up=20.0)

TABLE = TimingTable()
CODE_BITS, LEADING, POWER_DOWN_EDGES = 12, 2, 10


def now_ns() -> float:
    return float(get_sim_time("ns"))


class SerialConverters:
    """All converters of a board: `codes` is what each would convert at its next hold."""

    def __init__(self, dut: Any, channels: int, paths: Paths, table: TimingTable = TABLE, prefix: str = "") -> None:
        """`prefix`: that of the pins' names at the top of the bench."""
        self.channels, self.paths, self.table = channels, paths, table
        self.select = getattr(dut, f"{prefix}cs_no")
        self.clock = getattr(dut, f"{prefix}sclk_o")
        self.data = getattr(dut, f"{prefix}sdata_i")
        self.codes = [0] * channels
        self._stuck: dict[int, int] = {}
        self.trailing = [0] * channels  # what a part sends after its code: 0 in a sound one
        self.frames: list[int] = []  # falling edges of each finished frame
        self.asleep = False
        self.checked = True  # False while a frame is cut short on purpose
        self._lines = [1] * channels
        self._released_at = self._acquiring_at = self._selected_high_at = -1e9
        self._change = 0
        cocotb.start_soon(self._run())

    def stick(self, levels: dict[int, int]) -> None:
        """Hold lines at a level from now on (a fault); the others are sound."""
        self._stuck = levels
        self._drive(self._lines)

    def _drive(self, bits: list[int]) -> None:
        self._lines = bits
        self.data.value = sum(self._stuck.get(i, bit) << i for i, bit in enumerate(bits))

    async def _set_later(self, invalid_ns: float, valid_ns: float, bits: list[int]) -> None:
        """Right bits hold until `invalid_ns` from now, random ones until `valid_ns`."""
        self._change += 1
        mine = self._change
        await Timer(round(invalid_ns), "ns")
        if mine == self._change:
            self._drive([random.getrandbits(1) for _ in bits])
        await Timer(round(valid_ns) - round(invalid_ns), "ns")
        if mine == self._change:
            self._drive(bits)

    def _answer(self, earliest: float, latest: float, bits: list[int]) -> None:
        """The part's delay after an edge of this instant at the controller's flip-flop, as its flip-flop sees it."""
        path = self.paths.out + self.paths.back + self.paths.into
        cocotb.start_soon(self._set_later(self.paths.out + earliest, path + latest, bits))

    def _bits(self, held: list[int], number: int) -> list[int]:
        """Bit of this number, from 0, of every channel."""
        if self.asleep:
            return [random.getrandbits(1) for _ in held]
        if number < LEADING:
            return [0] * self.channels
        if number < LEADING + CODE_BITS:
            return [code >> (LEADING + CODE_BITS - 1 - number) & 1 for code in held]
        return list(self.trailing)

    def _check_select(self) -> None:
        t, now = self.table, now_ns()
        high = now - self._selected_high_at
        assert high >= t.select_high + self.paths.skew, f"t1: select high for {high} ns"
        quiet = now - self._released_at
        assert quiet >= t.quiet, f"tQUIET: {quiet} ns"
        acquired = now - self._acquiring_at
        assert acquired >= t.acquire + self.paths.skew, f"acquisition: {acquired} ns"
        assert self.clock.value == 1, "clock low when the converters are selected"

    async def _run(self) -> None:
        # Levels before the controller's reset mean nothing.
        while self.select.value != 1 or self.clock.value != 1:
            await First(ValueChange(self.clock), ValueChange(self.select))
        while True:
            while self.select.value != 0:
                await ValueChange(self.select)
            if self.checked:
                self._check_select()
            await self._frame()

    async def _frame(self) -> None:
        t = self.table
        held, falls, selected, fell, rose = list(self.codes), 0, now_ns(), 0.0, 0.0
        self._answer(0.0, t.enable, self._bits(held, 0))
        while True:
            await First(ValueChange(self.clock), ValueChange(self.select))
            now = now_ns()
            if self.select.value == 1:
                break
            if self.clock.value == 0:
                falls += 1
                if falls == 1:
                    setup = now - selected - self.paths.skew
                    assert setup >= t.select_to_clock, f"t2: {setup} ns"
                else:
                    period = now - fell
                    assert 1e9 / t.clock_max_hz <= period <= 1e9 / t.clock_min_hz, f"clock period {period} ns"
                    assert now - rose >= t.low_fraction * period, f"t6: high for {now - rose} ns"
                    assert rose - fell >= t.low_fraction * period, f"t5: low for {rose - fell} ns"
                fell = now
                if falls == 16:
                    self._release(t.hold, t.clock_release)
                else:
                    self._answer(t.hold, t.access, self._bits(held, falls))
            else:
                rose = now
                if falls == 13:
                    self._acquiring_at = now
        self._selected_high_at = now
        if falls < 16:
            self._release(0.0, t.select_release)
        if self.asleep and falls >= POWER_DOWN_EDGES:
            self.asleep = False
        elif 2 <= falls < POWER_DOWN_EDGES:
            self.asleep = True
        if self.checked:
            assert falls in (14, 16), f"{falls} falling edges in a frame"
        self.frames.append(falls)

    def _release(self, earliest: float, latest: float) -> None:
        self._released_at = now_ns() + self.paths.skew + latest
        self._answer(earliest, latest + self.paths.pull_up, [1] * self.channels)
