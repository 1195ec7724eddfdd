# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What the process that starts a simulation tells the simulator's process, and what it gets back."""

from __future__ import annotations

import pickle
from collections.abc import Generator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from fluxlock.can.frame import Frame
from fluxlock.can.timing import BitTiming
from fluxlock.plant import PlantParams
from fluxlock.python_load import PythonLoad

PLAN_ENV = "FLUXLOCK_PLAN"
PLAN_FILE = "plan.pickle"
RAW_FILE = "raw.npz"
META_FILE = "meta.json"
PROGRESS_FILE = "progress.json"
RECORDING_FILE = "recording.bin"
TRACE_FILE = "core.trace"  # `core_row_t` of the simulator's main


@dataclass(frozen=True)
class Action:
    """Something that happens at a clock cycle: a console line, a change of the plant, an upset of the chip.

    kind: "console" (line; burst: sent at once, not when the one before is answered), or arguments of a method of the
    plant: "load" (`set_load`), "supply" (`set_supply`), "fault" (`inject_fault`), "sensor" (`disturb`), "mechanics"
    (`set_mechanics`); "pin": an input of the chip is forced (`Native.force_pin`); "bus" (cycles, level): the CAN bus
    has this level for so many clocks; "frames" (frames): one more node on the bus sends them as fast as it can; or
    "register" (share, bit share: 0 to 1, of all registers and of its bits), "memory" (address, bit): a single bit that
    flips.
    """

    cycle: int
    kind: str
    arguments: dict[str, Any]


@dataclass(frozen=True)
class Branch:
    """A copy of the run that goes its own way from a cycle on: its actions come on top of the plan's.

    It ends `cycles` later, or when its actions are over and the drive has been in its fault state for `settle_cycles`.
    """

    cycle: int
    actions: tuple[Action, ...]
    cycles: int
    settle_cycles: int
    folder: Path


class ConversationError(Exception):
    """A conversation cannot go on; the text says why."""


class Dialogue(Protocol):
    """Whoever talks to the chip's console and decides by its answers. Pickled into the simulator's process.

    stage, share: how far it has come, in words and from 0 to 1.
    """

    stage: str
    share: float

    def conversation(self) -> Generator[str, list[str], Any]:
        """Yields lines, gets the lines of each reply up to `ok` or `error: TEXT`, returns what JSON can hold."""
        ...


class CanSide(Protocol):
    """What a peer on the chip's CAN bus does with its node (`fluxlock.cosim.native.CanNode`)."""

    def send(self, frame: Frame) -> None:
        """Queue a frame."""
        ...

    def take(self) -> Frame | None:
        """The oldest frame received."""
        ...

    @property
    def waiting(self) -> int:
        """Frames in the queue that have not been sent."""
        ...


@dataclass(frozen=True)
class CanPlace:
    """Where a peer's node is: its clock is fast by clock_error (relative), the chip delay_cycles away, each way."""

    clock_error: float = 0.0
    delay_cycles: float = 0.0


class CanPeer(Protocol):
    """Whoever is on the chip's CAN bus. Pickled into the simulator's process.

    timing: of its node, brp in clocks of the chip. finished: the run ends.
    """

    timing: BitTiming
    finished: bool

    def exchange(self, cycle: int, node: CanSide) -> None:
        """Called every `batch_cycles` and at the end: take frames, send frames."""
        ...

    def conclusion(self) -> object:
        """Of the run, what JSON can hold."""
        ...


@dataclass(frozen=True)
class SessionPlan:
    """One run, all in clock cycles.

    batch_cycles: interval at which Python wakes to drain the logs. marks: cycles at which processor time, that
    in Python and plant events are noted. gate_polarity: of the inverter, bit 0, 1: upper, lower gates are on at low
    level; a recording is replayed with 0. recording: also record the chip's inputs for a replay. dialogue: talks to the
    chip in place of the actions; the run ends with it, with a fault if that is not before `duration_cycles`.
    peer: is on the chip's CAN bus, at can_place; not with a dialogue. log_can: log the levels of chip and bus.
    branches: copies of the process from a cycle on, one after the other; the run itself ends with the last of them.
    watch: words of the soft core's memory that a copy looks at. trace: clocks from..to whose instructions the simulator
    writes down. gdb: file number of the socket at which the core waits for a debugger. Both need a chip that
    shows its core. own_load: written in Python, asked until the plan's end; not with a dialogue or branches.
    """

    plant: PlantParams
    seed: int
    clock_hz: float
    duration_cycles: int
    conversion_cycles: int
    bit_cycles: int
    actions: tuple[Action, ...] = ()
    final_commands: tuple[str, ...] = ("status", "faults", "stats")
    batch_cycles: int = 100_000
    marks: tuple[int, ...] = ()
    recording: bool = False
    log_strobes: bool = False
    gate_polarity: int = 0
    plant_mode: str = "jit"
    dialogue: Dialogue | None = None
    peer: CanPeer | None = None
    can_place: CanPlace = CanPlace()
    log_can: bool = False
    branches: tuple[Branch, ...] = ()
    watch: tuple[int, ...] = ()
    trace: tuple[int, int] | None = None
    gdb: int | None = None
    own_load: PythonLoad | None = None
    folder: Path = field(default_factory=Path)

    def save(self) -> Path:
        """Write the plan into its folder and return the file."""
        path = self.folder / PLAN_FILE
        path.write_bytes(pickle.dumps(self))
        return path

    @staticmethod
    def load(path: Path) -> SessionPlan:
        """Read a plan written by `save` in this checkout."""
        plan = pickle.loads(path.read_bytes())
        assert isinstance(plan, SessionPlan)
        return plan
