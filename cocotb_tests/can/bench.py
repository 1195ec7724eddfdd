# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What the tests of the CAN blocks share: sources, frames as the blocks' ports have them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from fluxlock.can.frame import Frame

CLOCK_NS = 20
BENCHES = Path(__file__).parent
BSP_SOURCES = [f"can/{name}.sv" for name in ("fl_can_pkg", "fl_can_bsp", "fl_can_confinement")]
CAN_SOURCES = [
    "common/fl_sync.sv",
    "common/fl_fifo.sv",
    *BSP_SOURCES,
    *(f"can/{name}.sv" for name in ("fl_can_bit_timing", "fl_can_tx", "fl_can_rx", "fl_can")),
]


def pack(frame: Frame) -> int:
    """A `can_frame_t`."""
    data = int.from_bytes(frame.data, "little")
    return frame.ext << 98 | frame.rtr << 97 | frame.id << 68 | frame.dlc << 64 | data


def unpack(word: int) -> Frame:
    """A frame from a `can_frame_t`; bytes beyond the length must be 0."""
    ext, rtr, dlc = bool(word >> 98 & 1), bool(word >> 97 & 1), word >> 64 & 0xF
    data = (word & (1 << 64) - 1).to_bytes(8, "little")
    count = 0 if rtr else min(dlc, 8)
    assert not any(data[count:]), f"bytes beyond the length: {data.hex()}"
    return Frame(word >> 68 & (1 << 29) - 1, ext, rtr, dlc, data[:count])


def told_apart(frame: Frame, number: int) -> Frame:
    """The frame with the sender's number in its identifier: two senders of one identifier would fight for ever."""
    shift = 18 if frame.ext else 0
    return replace(frame, id=frame.id & ~(3 << shift) | number << shift)
