# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Bit timing of a CAN node: time quanta, segments, synchronisation (ISO 11898-1).

Times are in any unit; a clock's own quantum gives the scale.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import floor


@dataclass(frozen=True)
class BitTiming:
    """Segments of a bit in time quanta, and what the controller's clock makes a quantum of."""

    brp: int  # clocks a quantum
    prop: int
    ps1: int
    ps2: int
    sjw: int

    @property
    def nbt(self) -> int:
        """Quanta a bit."""
        return 1 + self.prop + self.ps1 + self.ps2

    @property
    def bit_cycles(self) -> int:
        """Clocks a bit."""
        return self.brp * self.nbt

    @property
    def tolerance(self) -> float:
        """Largest relative error of each node's clock: drift over ten bits, and over thirteen to the end of a flag."""
        over_ten = self.sjw / (20 * self.nbt)
        over_flag = min(self.ps1, self.ps2) / (2 * (13 * self.nbt - self.ps2))
        return min(over_ten, over_flag)

    @property
    def packed(self) -> int:
        """The controller's `can_timing_t`."""
        fields = (self.sjw - 1, 4), (self.ps2 - 1, 4), (self.prop + self.ps1 - 1, 6), (self.brp - 1, 8)
        word = 0
        for value, width in fields:
            if not 0 <= value < 1 << width:
                raise ValueError(f"{self}: a value does not fit its {width} bits")
            word = word << width | value
        return word


QUANTA = 25


def chip_timing(clock_hz: float, kbit_s: int) -> BitTiming:
    """The timing that the firmware gives the controller: 25 quanta a bit, sample point at 80 %.

    >>> chip_timing(50e6, 500).bit_cycles
    100
    """
    bit_cycles = clock_hz / (1000 * kbit_s)
    brp = round(bit_cycles / QUANTA)
    if brp * QUANTA != bit_cycles:
        raise ValueError(f"{kbit_s} kbit/s has no whole bits of {QUANTA} quanta at {clock_hz:g} Hz")
    return BitTiming(brp, prop=11, ps1=8, ps2=5, sjw=4)


class BitClock:
    """When a node's bits begin and are sampled, moved by the edges it sees.

    The owner calls `sampled` and `ended` at the times `sample_at` and `end_at`, and `edge` when the level that the node
    sees falls from recessive to dominant.
    """

    def __init__(self, timing: BitTiming, quantum: float, start: float = 0.0) -> None:
        self.timing = timing
        self.quantum = quantum  # in the owner's unit of time
        self.begin = start  # of the bit
        self.before_sample = True
        self.hard = True  # a falling edge restarts the bit
        self.armed = True  # the last sample was recessive, no synchronisation since
        self.sample_at = 0.0
        self.end_at = 0.0
        self._plan()

    def _plan(self) -> None:
        timing = self.timing
        self.sample_at = self.begin + (1 + timing.prop + timing.ps1) * self.quantum
        self.end_at = self.begin + timing.nbt * self.quantum

    def sampled(self, level: int) -> None:
        """The sample point has been reached."""
        self.before_sample = False
        self.armed = level == 1

    def ended(self, hard: bool) -> None:
        """The bit is over; `hard` says whether the next one is in the space between frames."""
        self.begin = self.end_at
        self.before_sample = True
        self.hard = hard
        self._plan()

    def edge(self, now: float, dominant: bool) -> bool:
        """A falling edge; `dominant`: the node itself sends a dominant bit. True if the bit ended with the edge."""
        if not self.armed:
            return False
        self.armed = False
        place = floor((now - self.begin) / self.quantum)
        if self.hard:
            self.end_at = self.begin + place * self.quantum
            return True
        if self.before_sample:
            if place > 0 and not dominant:
                self.begin += min(place, self.timing.sjw) * self.quantum
                self._plan()
            return False
        early = self.timing.nbt - place
        self.end_at -= min(early, self.timing.sjw) * self.quantum
        return self.end_at <= now
