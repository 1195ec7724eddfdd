# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The chip's CAN controller on the simulator's native bus, its registers written by a program on the core."""

from __future__ import annotations

import random
from dataclasses import dataclass, field, replace
from pathlib import Path

import pytest

from cocotb_tests.can.bench import told_apart
from fluxlock.base.paths import ROOT
from fluxlock.can.frame import Frame
from fluxlock.can.timing import BitTiming
from fluxlock.clock import CLOCK_HZ
from fluxlock.config import load_inverter, load_motor
from fluxlock.config.motor import machine_params
from fluxlock.cosim.chip import build_chip
from fluxlock.cosim.convert import inverter_params, sensing_params
from fluxlock.cosim.launch import run_plan
from fluxlock.cosim.plan import CanPlace, CanSide
from fluxlock.cosim.program import Row, script_plan, wait
from fluxlock.plant import MechanicsParams, PlantParams, RecordingParams

MEGABIT = BitTiming(2, 9, 7, 8, 4)
TICK = 10_000  # clocks: no frame takes longer
FRAMES = 12
SEED = 1


@dataclass
class Peer:
    """Sends its frames, one a wake-up, keeps what it gets. glitch: clocks until the bus is dominant for a bit."""

    timing: BitTiming
    frames: list[Frame]
    glitch: int = 0
    taken: list[Frame] = field(default_factory=list)
    state: list[int] = field(default_factory=list)
    finished: bool = False

    def exchange(self, cycle: int, node: CanSide) -> None:
        if self.frames:
            node.send(self.frames.pop(0))
            if self.glitch:
                # The protocol of a side knows no disturbance; the native bus's node, which this one is, does.
                begin = cycle + self.glitch
                node.disturb(begin, begin + self.timing.bit_cycles, 0)  # type: ignore[attr-defined]
        while (frame := node.take()) is not None:
            self.taken.append(frame)
        state = node.state  # type: ignore[attr-defined]
        self.state = [state.waiting, state.sent, state.errors, state.tec, state.rec]

    def conclusion(self) -> object:
        return {"taken": [repr(frame) for frame in self.taken], "state": self.state}


def commands(frame: Frame, buffer: int) -> list[Row]:
    data = int.from_bytes(frame.data, "little")
    return [
        Row("can.tx_id", 0, frame.ext << 31 | frame.rtr << 30 | frame.id),
        Row("can.tx_data", 0, data & 0xFFFF_FFFF),
        Row("can.tx_data", 1, data >> 32),
        Row("can.tx_command", 0, 1 << buffer | frame.dlc << 8),
    ]


FAR = 5.0  # clocks: there and back, and the chip's own way, within the propagation segment


@pytest.mark.parametrize(
    ("place", "glitch"),
    [(CanPlace(), 0), (CanPlace(0.005, FAR), 0), (CanPlace(-0.005, FAR), 0), (CanPlace(), 2_500)],
    ids=["near", "far-fast", "far-slow", "disturbed"],
)
def test_frames_both_ways(tmp_path: Path, place: CanPlace, glitch: int) -> None:
    """Chip and node send at the same time: every frame arrives once and unchanged, no error on the bus.

    Also where the node is away and its clock wrong by 0.5 %. Where the bus is disturbed errors are found and everything
    is sent all the same.

    Verifies: CAN-26, CAN-27
    """
    seed = random.randrange(1 << 32)
    print(f"seed {seed}")
    rng = random.Random(seed)
    mine, others = ([told_apart(Frame.draw(rng), x) for _ in range(FRAMES)] for x in range(2))
    timing = MEGABIT
    word = timing.brp - 1 | (timing.prop + timing.ps1 - 1) << 8 | (timing.ps2 - 1) << 16 | (timing.sjw - 1) << 24
    rows = [Row("can.bit_timing", 0, word), Row("can.filter_mask", 0, 1 << 29), Row("can.control", 0, 1)]
    rows += [Row("timer.tick_period", 0, TICK), wait(2)]
    for i, frame in enumerate(mine):
        rows += [*commands(frame, i % 3), wait(2)]
    motor = load_motor(ROOT / "motors" / "motor-1.toml")
    inverter = load_inverter(ROOT / "inverters" / "bench-25v-120a.toml")
    plant = PlantParams(
        machine=machine_params(motor),
        inverter=inverter_params(inverter),
        sensing=sensing_params(inverter, motor.phases),
        mechanics=MechanicsParams(motor.inertia_kgm2, mode="locked"),
        recording=RecordingParams(every_strobes=1),
        clock_period_s=1.0 / CLOCK_HZ,
    )
    plan = script_plan(rows, plant, (2 * FRAMES + 8) * TICK / CLOCK_HZ, tmp_path, SEED)
    plan = replace(plan, peer=Peer(timing, others, glitch), can_place=place, batch_cycles=TICK)
    meta = run_plan(plan, build_chip(can=True))
    assert not meta["fault"]
    found = meta["conclusion"]
    if glitch:  # a sender that is disturbed behind the end of the frame sends it twice
        assert set(found["taken"]) == {repr(frame) for frame in mine}
        assert found["state"][:2] == [0, FRAMES] and found["state"][2] > 0
        return
    assert found["taken"] == [repr(frame) for frame in mine]
    assert found["state"] == [0, FRAMES, 0, 0, 0]
