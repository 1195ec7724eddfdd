# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""What a co-simulation run hands to the analysis, and the trace file that keeps it.

Times are clock cycles since time 0 of the simulation (rising edges, 64 bit). Angles are electrical, in rad,
in the convention of the plant: theta = d axis against phase A.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from enum import IntEnum
from pathlib import Path

import numpy as np
import numpy.typing as npt

from fluxlock.interface.names import words

IntArray = npt.NDArray[np.int64]
FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]
BoolArray = npt.NDArray[np.bool_]
RecordArray = npt.NDArray[np.void]


class LogKind(IntEnum):
    """Kinds of rows `[cycle, kind, a, b]` in the log of the chip."""

    GATES = 1  # a = gates before polarity, bit 2X upper, 2X+1 lower switch of leg X
    COMMUTATION = 2  # a = new sector 0..5, b = scheduled instant at the gates (cycle)
    CROSSING = 3  # a = sector | late << 4, b = time of the crossing that the chip claims (cycle)
    TRIP = 4  # a = causes, bits in the order of TRIP_CAUSES
    # Shadowed settings took effect; a, b: what the firmware publishes of the drive then (sim/native/cosim.h), see
    # `RunData.states`.
    UPDATE = 5
    STROBE = 6  # sample strobe; logged on request
    PINS = 7  # a = pins at the chip, bit 0 gate-driver fault, 1 to 3 Hall A, B, C
    # Current sample of the vector path; a = angle of the frame there, b = what firmware publishes beyond it,
    # 2^32 = one turn.
    ANGLE = 8
    CAN = 9  # a = chip's transmit pin | level of the bus << 1; logged on request
    ENABLE = 10  # a = level of a board's driver enable, which toggles


class PlantEventKind(IntEnum):
    """Kinds of plant events."""

    EXTINCTION = 1  # the current of an open leg became zero: its freewheeling ended
    DIODE_ON = 2  # the diode of a floating leg started to conduct


# Bits of a trip cause, least significant first (`trip_t` of the RTL package).
TRIP_CAUSES = words("trip")

RECORD_DTYPE = np.dtype(
    [
        ("t_cycle", "f8"),
        ("theta_e", "f8"),  # rad, unwrapped
        ("omega_e", "f8"),  # rad/s
        ("ia", "f8"),  # A, into the machine
        ("ib", "f8"),
        ("ic", "f8"),
        ("va", "f8"),  # V, true terminal voltage against the negative rail
        ("vb", "f8"),
        ("vc", "f8"),
        ("vdc", "f8"),
        ("idc", "f8"),  # A, drawn from the DC link
        ("torque_nm", "f8"),
        ("gates", "i8"),
    ]
)
# The drive by its own account, at every update of the chip: state and limit as the firmware numbers them, lost locks
# since boot, speed as a magnitude with six-step.
STATE_DTYPE = np.dtype(
    [
        ("t_s", "f8"),
        ("state", "i8"),
        ("limit", "i8"),
        ("lost_locks", "i8"),
        ("speed_rpm", "f8"),
        ("reference_rpm", "f8"),
        ("target_rpm", "f8"),
    ]
)
PLANT_EVENT_DTYPE = np.dtype([("t_cycle", "f8"), ("kind", "i8"), ("phase", "i8"), ("theta_e", "f8")])


@dataclass(frozen=True)
class Rejection:
    """A console line of the scenario that the drive refused: when it was sent, and the reason."""

    time_s: float
    line: str
    reason: str


@dataclass
class RunData:
    """Everything measured in one run.

    log: int64 [n, 4] rows as LogKind says; stamps are unwrapped to the same cycle count as the first column.
    records: waveforms on a coarse regular grid; zoom: the same at every event inside the zoom window.
    isr: handler name -> {"min", "mean", "max", "count"} in clock cycles.
    rejected: console lines of the scenario that the drive did not carry out.
    """

    log: IntArray
    records: RecordArray
    plant_events: RecordArray
    zoom: RecordArray
    clock_hz: float
    pole_pairs: int
    cycles: int
    wall_s: float
    seed: int
    uart: list[str] = field(default_factory=list)
    isr: dict[str, dict[str, float]] = field(default_factory=dict)
    overruns: int = 0
    rejected: list[Rejection] = field(default_factory=list)

    @property
    def duration_s(self) -> float:
        """Simulated time."""
        return self.cycles / self.clock_hz

    @property
    def fault(self) -> str | None:
        """Fault in which the drive ended, by its last reply to `status`; None: without one, or it was not asked."""
        # The log of `faults` adds a tick to the name.
        named = [line.removeprefix("fault ").strip() for line in self.uart if re.fullmatch(r"fault \w+\s*", line)]
        return named[-1] if named and named[-1] != "none" else None

    @property
    def failed_phase(self) -> str | None:
        """Phase in which the last attempt at a start failed, by the last reply to `faults`; None: fault is another."""
        found = re.findall(r"^now (\w+)\s*(?:phase (\w+))?", "\n".join(self.uart), re.MULTILINE)
        return found[-1][1] or None if found and found[-1][0] == self.fault else None

    def rows(self, kind: LogKind) -> IntArray:
        """Log rows of one kind."""
        found: IntArray = self.log[self.log[:, 1] == int(kind)]
        return found

    def states(self) -> RecordArray:
        """What the drive said of itself over time, one STATE_DTYPE a row."""
        rows = self.rows(LogKind.UPDATE)
        found = np.zeros(len(rows), STATE_DTYPE)
        found["t_s"] = rows[:, 0] / self.clock_hz
        drive, command = rows[:, 2], rows[:, 3]
        found["state"], found["limit"], found["lost_locks"] = drive & 0xFF, drive >> 16 & 0xF, drive >> 20 & 0xFFF
        found["speed_rpm"] = (drive >> 32) / 256
        found["reference_rpm"] = command.astype(np.int32) / 256
        found["target_rpm"] = command >> 32
        return found


class SimulationFault(Exception):
    """The run could not be completed: fault of the plant, the chip or the simulator.

    data: what was recorded until then, if anything.

    >>> str(SimulationFault("plant fault 2 at cycle 1000"))
    'plant fault 2 at cycle 1000'
    """

    def __init__(self, message: str, data: RunData | None = None) -> None:
        super().__init__(message)
        self.data = data


def trip_cause_names(mask: int) -> list[str]:
    """Names of the causes in a trip mask."""
    return [name for bit, name in enumerate(TRIP_CAUSES) if mask >> bit & 1]


def save_trace(path: Path, data: RunData) -> None:
    """Write the trace file (NumPy .npz). Depends on the run only: the same run gives the same bytes."""
    np.savez_compressed(
        path,
        allow_pickle=False,
        log=data.log,
        records=data.records,
        plant_events=data.plant_events,
        zoom=data.zoom,
        uart=np.array(data.uart, dtype=np.str_),
        clock_hz=np.float64(data.clock_hz),
        pole_pairs=np.int64(data.pole_pairs),
        cycles=np.int64(data.cycles),
        seed=np.int64(data.seed),
        rejected=np.array([[repr(r.time_s), r.line, r.reason] for r in data.rejected], dtype=np.str_).reshape(-1, 3),
    )


def load_trace(path: Path) -> RunData:
    """Read a trace file. Wall time and interrupt statistics are not part of it."""
    with np.load(path, allow_pickle=False) as file:
        return RunData(
            log=file["log"],
            records=file["records"],
            plant_events=file["plant_events"],
            zoom=file["zoom"],
            clock_hz=float(file["clock_hz"]),
            pole_pairs=int(file["pole_pairs"]),
            cycles=int(file["cycles"]),
            wall_s=0.0,
            seed=int(file["seed"]),
            uart=[str(line) for line in file["uart"]],
            rejected=[Rejection(float(time_s), str(line), str(why)) for time_s, line, why in file["rejected"]],
        )
