# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The CAN bus of a chip on the page: the node beside it, and how much of the time the bus carries frames."""

from __future__ import annotations

import math

from fluxlock.can.frame import Frame
from fluxlock.can.timing import BitTiming
from fluxlock.cosim.plan import CanSide
from fluxlock.results.rundata import IntArray, LogKind

END_BITS = 11  # recessive behind the last dominant bit of a frame: delimiter of the acknowledge, end, intermission
WINDOW_CYCLES = 500_000  # over which the load is taken
ASK_CYCLES = 500_000  # between two questions to the drive: 10 ms
BOOT_UP, NMT_START, ASK = 0x700, 1, 0x600
DEVICE_TYPE = bytes([0x40, 0x00, 0x10, 0, 0, 0, 0, 0])  # SDO request to read 0x1000


class Companion:
    """A master that commands nothing: it acknowledges, starts the node, and asks often enough not to be missed.

    silent: it acknowledges only.
    """

    finished = False
    silent = False

    def __init__(self, timing: BitTiming, node_id: int) -> None:
        self.timing, self._node_id, self._asked = timing, node_id, 0

    def exchange(self, cycle: int, node: CanSide) -> None:
        """Take what has come, send what is due."""
        while (frame := node.take()) is not None:
            if frame.id == BOOT_UP + self._node_id and frame.data == b"\0" and not self.silent:
                node.send(Frame(0, False, False, 2, bytes([NMT_START, self._node_id])))
        if cycle - self._asked >= ASK_CYCLES and node.waiting == 0 and not self.silent:
            self._asked = cycle
            node.send(Frame(ASK + self._node_id, False, False, 8, DEVICE_TYPE))

    def conclusion(self) -> object:
        """Nothing to tell."""
        return None


class BusLoad:
    """Part of the time in which frames are on the bus, from the levels in the log. bit_cycles: clocks of a bit."""

    def __init__(self, bit_cycles: float) -> None:
        self._end_cycles = END_BITS * bit_cycles
        self._since = self._counted = 0.0  # begin of the window, and up to where it is counted
        self._idle = 0.0  # clocks of the window
        self._recessive = -math.inf  # since when
        self._level = 1
        self.percent = math.nan

    def follow(self, log: IntArray, cycle: int) -> None:
        """The next stretch of the log, up to a clock."""
        for at, _, levels, _ in log[log[:, 1] == LogKind.CAN].tolist():
            level = levels >> 1 & 1
            if level == self._level:
                continue
            self._count(at)
            self._level = level
            if level:
                self._recessive = at
        self._count(cycle)
        if cycle - self._since >= WINDOW_CYCLES:
            self.percent = 100.0 * (1.0 - self._idle / (cycle - self._since))
            self._since, self._idle = cycle, 0.0

    def _count(self, cycle: float) -> None:
        if self._level:
            self._idle += max(0.0, cycle - max(self._counted, self._recessive + self._end_cycles))
        self._counted = cycle
