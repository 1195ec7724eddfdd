# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""Clocks of the boards, and the limits that their monitors need, by the tolerance of the on-chip oscillator."""

from __future__ import annotations

import math
from dataclasses import dataclass

BEAT_CYCLES = 64  # between two toggles that one clock makes for the other


@dataclass(frozen=True)
class BoardClocks:
    """The chip's clock and the oscillator that watches it."""

    top: str
    osc_hz: float
    tolerance: float  # of the oscillator, either way
    clock_hz: float = 50e6


BOARDS = (
    BoardClocks("fl_board_ulx3s", 310e6 / 8, 0.15),
    BoardClocks("fl_board_arty", 65e6, 0.50),
)


def limits(board: BoardClocks) -> tuple[int, int, int, int]:
    """Least and most clocks of the oscillator in a beat of the chip's clock, then the reverse.

    The mean of a beat falls between two whole numbers, and the synchroniser may move it by one more.
    """
    low, high = board.osc_hz * (1 - board.tolerance), board.osc_hz * (1 + board.tolerance)

    def least(ratio: float) -> int:
        return math.floor(BEAT_CYCLES * ratio) - 1

    def most(ratio: float) -> int:
        return math.ceil(BEAT_CYCLES * ratio) + 1

    return (
        least(low / board.clock_hz),
        most(high / board.clock_hz),
        least(board.clock_hz / high),
        most(board.clock_hz / low),
    )
