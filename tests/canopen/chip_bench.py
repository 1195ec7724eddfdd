"""The chip with its CANopen node on the simulator's bus: peers beside it, runs of a scenario."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from fluxlock.analysis.rundata import RunData
from fluxlock.can.timing import BitTiming, chip_timing
from fluxlock.config import load_scenario
from fluxlock.config.specs import CLOCK_HZ
from fluxlock.cosim.launch import run_plan
from fluxlock.cosim.plan import CanPeer, CanSide
from fluxlock.cosim.run import collect, prepare, ready_chip
from fluxlock.paths import ROOT

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


def run_chip(
    folder: Path,
    overrides: tuple[str, ...],
    seconds: float,
    peer: CanPeer | None = None,
    batch_cycles: int = 5_000,
    log_can: bool = False,
    scenario: str = "demo.toml",
) -> tuple[RunData, Any]:
    """What a run of the chip with CAN has recorded, and the peer's conclusion."""
    loaded = load_scenario(ROOT / "scenarios" / scenario, overrides)
    plan = prepare(loaded, folder, 1, stop_cycle=round(seconds * CLOCK_HZ))
    plan = replace(plan, peer=peer, batch_cycles=batch_cycles, log_can=log_can)
    meta = run_plan(plan, ready_chip(can=True))
    assert not meta["fault"], meta["fault"]
    return collect(plan, meta, loaded.motor.pole_pairs), meta["conclusion"]
