# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The CAN master of a campaign: enables the operation, commands all the time, keeps the names that the node sends."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass, field

from fluxlock.can.frame import Frame
from fluxlock.can.timing import BitTiming, chip_timing
from fluxlock.clock import CLOCK_HZ
from fluxlock.config import Scenario
from fluxlock.cosim.plan import CanSide

BOOT_CYCLES = 300_000
COMMAND_TIMEOUT_MS = 20
REACT_FAULT, GATES_OFF = 1, 0
ENABLED = 0x0F
# Emergency codes of what only the node knows; a fault of the drive stands in its state too.
NAMES = {0x8100: "command_timeout", 0x8140: "bus_off"}


def _sdo(node_id: int, index: int, sub: int, value: int, size: int) -> Frame:
    """An expedited download."""
    command = 0x23 | 4 - size << 2
    return Frame(0x600 + node_id, dlc=8, data=struct.pack("<BHBi", command, index, sub, value))


@dataclass
class Master:
    """Sets timeout and reactions up, then a command at each wake-up. queue: what is left of the set-up."""

    node_id: int
    target_rpm: int
    timing: BitTiming
    finished: bool = False
    queue: list[Frame] = field(default_factory=list)
    told: list[tuple[int, int]] = field(default_factory=list)  # cycle, emergency code

    def __post_init__(self) -> None:
        words = [(0x2010, 1, COMMAND_TIMEOUT_MS, 2), (0x2010, 2, REACT_FAULT, 1), (0x605E, 0, GATES_OFF, 2)]
        words += [(0x60FF, 0, self.target_rpm, 4), (0x6040, 0, 0x06, 2), (0x6040, 0, 0x07, 2), (0x6040, 0, ENABLED, 2)]
        self.queue = [Frame(0, dlc=2, data=bytes([1, self.node_id])), *(_sdo(self.node_id, *word) for word in words)]

    def exchange(self, cycle: int, node: CanSide) -> None:
        """Keep emergencies, send the next frame; none piles up while the bus carries nothing."""
        while (frame := node.take()) is not None:
            if frame.id == 0x80 + self.node_id:
                self.told.append((cycle, int.from_bytes(frame.data[:2], "little")))
        if cycle < BOOT_CYCLES or node.waiting:
            return
        command = Frame(0x400 + self.node_id, dlc=6, data=struct.pack("<Hi", ENABLED, self.target_rpm))
        node.send(self.queue.pop(0) if self.queue else command)

    def conclusion(self) -> object:
        """Emergencies with their cycles."""
        return self.told


def master_of(scenario: Scenario) -> Master:
    """The master of a scenario with a bus; it asks for the scenario's last speed."""
    assert scenario.can is not None
    rate = scenario.can.bit_rate_kbit_per_s
    return Master(scenario.can.node_id, round(scenario.speed_targets()[-1][1]), chip_timing(CLOCK_HZ, rate))


def told_since(conclusion: Sequence[tuple[int, int]] | None, cycle: int) -> list[str]:
    """Names in a master's conclusion from a cycle on; none without a master."""
    return [NAMES[code] for at, code in conclusion or () if at >= cycle and code in NAMES]
