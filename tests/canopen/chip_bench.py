# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The chip with its CANopen node on the simulator's bus: peers beside it, runs of a scenario."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from fluxlock.base.paths import ROOT
from fluxlock.can.frame import Frame
from fluxlock.can.timing import BitTiming, chip_timing
from fluxlock.clock import CLOCK_HZ
from fluxlock.config import load_scenario
from fluxlock.cosim.chip import build_chip
from fluxlock.cosim.launch import run_plan
from fluxlock.cosim.native import peek
from fluxlock.cosim.plan import Action, CanPeer, CanSide
from fluxlock.cosim.run import collect, prepare
from fluxlock.firmware import build_bus_library
from fluxlock.firmware.binding import types
from fluxlock.generate.memory import STACK_ADDRESS, STACK_BYTES, STACK_PAINT, TELEMETRY_ADDRESS
from fluxlock.results.rundata import RunData
from tests.canopen.node_bench import NODE

MEGABIT = chip_timing(CLOCK_HZ, 1000)
CAN = "can={node_id=5, bit_rate_kbit_per_s=1000}"
# A rotor that is caught at once.
SPINNING = ("initial.speed_rpm=40000", "window=[]", "expect=[]")


@dataclass
class Listener:
    """Acknowledges what the chip sends, and keeps it."""

    timing: BitTiming = MEGABIT
    finished: bool = False
    frames: tuple[tuple[int, str], ...] = ()

    def exchange(self, cycle: int, node: CanSide) -> None:
        while (frame := node.take()) is not None:
            self.frames += ((frame.id, frame.data.hex()),)

    def conclusion(self) -> object:
        return self.frames


@dataclass
class Talker(Listener):
    """Also sends its frames, one at a wake-up after the boot."""

    queue: list[Frame] = field(default_factory=list)

    def exchange(self, cycle: int, node: CanSide) -> None:
        super().exchange(cycle, node)
        if cycle > 300_000 and self.queue:
            node.send(self.queue.pop(0))


def stack_used_bytes() -> int:
    """Most that the stack has held since the start: above the last word with its paint. For a peer."""
    words = peek(STACK_ADDRESS, STACK_BYTES // 4)
    return STACK_BYTES - 4 * next((i for i, word in enumerate(words) if word != STACK_PAINT), len(words))


def sdo(index: int, sub: int, value: int, size: int) -> Frame:
    """An expedited download to the node."""
    command = 0x23 | 4 - size << 2
    return Frame(0x600 + NODE, dlc=8, data=struct.pack("<BHBi", command, index, sub, value))


@dataclass
class Flood:
    """Enables the operation with a target, then sends its frames back to back, now and then a new target between them.

    start_cycle: of the flood. Latency of a command: from the wake-up that sees it acknowledged to the one that sees the
    drive's target changed.
    """

    frames: list[Frame]
    start_cycle: int
    rpm: int
    every: int = 250  # frames from one command to the next
    timing: BitTiming = MEGABIT
    finished: bool = False
    setup: list[Frame] = field(default_factory=list)
    next: int = 0
    commands: list[tuple[int, int]] = field(default_factory=list)  # number of the frame, target
    latency: list[int] = field(default_factory=list)
    acknowledged: int = 0
    offset: int = 0  # frames sent before the flood
    dry: int = 0  # wake-ups that found the queue empty
    answers: int = 0
    refused: int = 0
    emergencies: tuple[str, ...] = ()
    span: tuple[int, int] = (0, 0)

    def __post_init__(self) -> None:
        velocity = sdo(0x60FF, 0, self.rpm, 4)
        words = [sdo(0x6040, 0, word, 2) for word in (0x06, 0x07, 0x0F)]
        self.setup = [Frame(0, dlc=2, data=bytes([1, NODE])), velocity, *words]

    def exchange(self, cycle: int, node: CanSide) -> None:
        while (frame := node.take()) is not None:
            self.answers += frame.id == 0x580 + NODE
            self.refused += frame.id == 0x580 + NODE and frame.data[0] == 0x80
            if frame.id == 0x80 + NODE:
                self.emergencies += (frame.data.hex(),)
        sent = node.state.sent  # type: ignore[attr-defined]
        if cycle < self.start_cycle:
            if self.setup and cycle % 100_000 == 0 and cycle >= 500_000:
                node.send(self.setup.pop(0))
            self.offset = sent
            return
        if not self.span[0]:
            self.span = cycle, 0
        self._watch(cycle, sent - self.offset)
        if self.next < len(self.frames):
            self.dry += node.waiting == 0 and self.next > 0
            while node.waiting < 6 and self.next < len(self.frames):
                if self.next % self.every == self.every // 2:
                    self._command(node)
                node.send(self.frames[self.next])
                self.next += 1
        elif node.waiting == 0:
            self.span = self.span[0], self.span[1] or cycle
            self.finished = cycle > self.span[1] + 500_000

    def _command(self, node: CanSide) -> None:
        rpm = self.rpm - 100 * (1 + len(self.commands) % 2)
        self.commands.append((self.next + len(self.commands) + 1, rpm))
        node.send(Frame(0x400 + NODE, dlc=6, data=struct.pack("<Hi", 0x0F, rpm)))

    def _watch(self, cycle: int, sent: int) -> None:
        if len(self.latency) == len(self.commands):
            return
        number, rpm = self.commands[len(self.latency)]
        if sent >= number and not self.acknowledged:
            self.acknowledged = cycle
        (target,) = peek(TELEMETRY_ADDRESS + types().offsetof("telemetry_t", "target_rpm"), 1).view(np.int32)
        if self.acknowledged and target == rpm:
            self.latency.append(cycle - self.acknowledged)
            self.acknowledged = 0

    def conclusion(self) -> object:
        return {
            "latency": self.latency,
            "commands": len(self.commands),
            "dry": self.dry,
            "answers": self.answers,
            "refused": self.refused,
            "emergencies": self.emergencies,
            "span": self.span,
            "stack_bytes": stack_used_bytes(),
        }


def run_chip(
    folder: Path,
    overrides: tuple[str, ...],
    seconds: float,
    peer: CanPeer | None = None,
    batch_cycles: int = 5_000,
    log_can: bool = False,
    scenario: str = "demo.toml",
    native: bool = False,
    actions: tuple[Action, ...] = (),
) -> tuple[RunData, Any]:
    """What a run of the chip with CAN has recorded, and the peer's conclusion. native: without core, six-step."""
    loaded = load_scenario(ROOT / "scenarios" / scenario, overrides)
    plan = prepare(loaded, folder, 1, stop_cycle=round(seconds * CLOCK_HZ))
    plan = replace(plan, peer=peer, batch_cycles=batch_cycles, log_can=log_can, actions=(*plan.actions, *actions))
    firmware = build_bus_library(can_method="six-step") if native else None
    meta = run_plan(plan, build_chip(can=True, native=native), firmware=firmware)
    assert not meta["fault"], meta["fault"]
    return collect(plan, meta, loaded.motor.pole_pairs), meta["conclusion"]
