# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A CANopen node that hangs on the chip."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path

from fluxlock.can.frame import Frame
from fluxlock.clock import CLOCK_HZ
from fluxlock.cosim.broken_code import TO_ITSELF, rewrite, symbols
from fluxlock.cosim.plan import CanSide
from fluxlock.firmware import build_firmware
from fluxlock.firmware.binding import names
from fluxlock.results.rundata import LogKind
from tests.canopen.chip_bench import CAN, SPINNING, Listener, run_chip
from tests.canopen.node_bench import NODE

BREAK_S = 0.05
NODE_S = 0.05  # window of the node
REPORT_S = 1e-3
RESTART = 0x2025


@dataclass
class Questioner(Listener):
    """Asks for the objects of the restart when the node has told its boot-up for the second time."""

    boot_ups: int = 0
    asked: int = 0

    def exchange(self, cycle: int, node: CanSide) -> None:
        known = len(self.frames)
        super().exchange(cycle, node)
        new = self.frames[known:]
        self.boot_ups += new.count((0x700 + NODE, "00"))
        answered = any(id_ == 0x580 + NODE for id_, _ in new)
        if self.boot_ups == 2 and self.asked < 6 and (answered or not self.asked):
            self.asked += 1
            data = struct.pack("<BHBi", 0x40, RESTART, self.asked, 0)
            node.send(Frame(0x600 + NODE, dlc=8, data=data))


def test_node_hangs(tmp_path: Path) -> None:
    """A node that goes round in itself opens the gates within its window; the node that boots anew names it on the bus.

    Verifies: FW-93
    """
    image = build_firmware(can_method="six-step")
    at, _ = symbols(image.with_suffix(".elf"))["link_status"]
    moments = (BREAK_S, BREAK_S + NODE_S + 1e-3)
    there, back = (rewrite(image, at, TO_ITSELF, round(s * CLOCK_HZ)) for s in moments)
    data, frames = run_chip(tmp_path, (CAN, *SPINNING), 0.12, Questioner(), actions=(*there, *back))
    gates_s = data.rows(LogKind.GATES)[-1, 0] / CLOCK_HZ
    assert BREAK_S + NODE_S - 1e-3 < gates_s < BREAK_S + NODE_S + REPORT_S
    answers = [struct.unpack("<BHBI", bytes.fromhex(text)) for id_, text in frames if id_ == 0x580 + NODE]
    value = {sub: value for _, index, sub, value in answers if index == RESTART}
    assert (value[1], value[2], value[4]) == (1, 3, at)
    assert 300 < value[6] < 3072
    number = names("fault_t").index("can_node")
    emcy = [bytes.fromhex(text) for id_, text in frames if id_ == 0x80 + NODE]
    assert [(struct.unpack("<H", e[:2])[0], e[3]) for e in emcy] == [(0x6010, number)]
