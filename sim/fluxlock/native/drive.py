# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A whole drive in this process: averaged motor and chip, the firmware's C, its CANopen node. One a process."""

from __future__ import annotations

from fluxlock.config import ConfigError, Scenario
from fluxlock.firmware import build_canopen_library
from fluxlock.native.chip import AveragedChip
from fluxlock.native.node import HostNode

STEP_US = 1000


class NativeDrive:
    """Motor, drive and node, a millisecond a step. The chip's library must hold the node."""

    def __init__(self, chip: AveragedChip, node_id: int) -> None:
        self.chip = chip
        self.node = HostNode(chip.fw.lib, node_id)
        self.now_us = 0
        self._ticks = round(STEP_US / 1e6 / chip.tick_s)
        # The library keeps it for the process: a new drive has stored nothing.
        self.node.memory = bytes(len(self.node.memory))
        self.node.boot(self.now_us)

    def step(self) -> None:
        """Motor and firmware for a millisecond, then the node."""
        for _ in range(self._ticks):
            self.chip.step()
        self.now_us += STEP_US
        self.node.step(self.now_us)


def drive_of_scenario(scenario: Scenario, node_id: int) -> NativeDrive:
    """Motor, inverter, drive, load and initial state of a scenario; ConfigError for what the averaged motor is not."""
    problems = []
    if scenario.drive.method != "six-step":
        problems.append(
            scenario.sources.problem("drive.method", "without --play the motor is driven in six steps only")
        )
    if scenario.drive.hall.mode != "off":
        problems.append(scenario.sources.problem("drive.hall.mode", "the native program has no Hall sensors"))
    if problems:
        raise ConfigError(problems)
    return NativeDrive(AveragedChip(scenario, library=build_canopen_library()), node_id)
