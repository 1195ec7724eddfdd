# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""The grid: drives, their moments, what a fault is, and the fault names by which a drive may stop."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from fluxlock.base.paths import ROOT
from fluxlock.config import Scenario, load_scenario
from fluxlock.interface.names import fault_names

RUN_S = 0.040
UPSET_S = 0.015
# Twelve looks of the slow protection, and one more: 64 ticks of up to 125 us.
SLOW_S = 0.110

Change = tuple[float, str, Mapping[str, object]]  # after the moment (s), kind and arguments of an `Action`


def _faults(*names: str) -> frozenset[str]:
    """Faults of the drive by their names."""
    if unknown := sorted(set(names) - set(fault_names())):
        raise ValueError(f"the drive has no fault {unknown[0]}")
    return frozenset(names)


CURRENT = _faults("phase_over_current", "dc_over_current")
LOCK = _faults("lost_lock", "angle_lost", "stalled", "overhauled", "start_failed")
LINK = _faults("under_voltage", "over_voltage")
CHANNEL = _faults("voltage_channel", "stuck_channel", "current_sum")
PIN = _faults("fault_pin")
CONVERTER = _faults("converter")
CLOCK = _faults("clock")
SETTINGS = _faults("settings_changed")
PARAMETERS = _faults("parameter_magic", "parameter_version", "parameter_crc")
EXCEPTION = _faults("exception")
MAIN_LOOP = _faults("main_loop")
CAN_NODE = _faults("can_node")
STACK = _faults("stack_overflow")
WATCHDOG = _faults("watchdog", "no_samples")
SHORTED = _faults("shorted_winding")
INJECTION = _faults("injection_signal", "injection_noise", "no_saliency", "polarity_unsure")
BUS = _faults("command_timeout") | {"bus_off"}  # the bus tells the other
NONE: frozenset[str] = frozenset()  # no stop is right
ANY = frozenset({"*"})


@dataclass(frozen=True)
class Fault:
    """One thing that goes wrong. names: faults that tell it rightly; "*": only gates and currents are judged.

    must_stop: riding through is no right end. turning: only where the machine is driven already. active: only where
    the drive starts, runs or stops. span_s: until the run is judged; one that stops is judged earlier. unchecked:
    breaks what an assertion of the RTL takes for granted. off_s: within which gates and the drivers' enable are off, to
    the end of the run. silent: the chip that could tell a name stands still or begins anew.
    """

    name: str
    changes: tuple[Change, ...]
    names: frozenset[str]
    must_stop: bool = False
    turning: bool = False
    active: bool = False
    span_s: float = RUN_S
    unchecked: bool = False
    off_s: float | None = None
    silent: bool = False

    @property
    def upset(self) -> bool:
        """A bit of the chip that flips."""
        return any(kind in ("register", "memory") for _, kind, _ in self.changes)


@dataclass(frozen=True)
class Moment:
    """An instant of a drive's scenario at which its runs part.

    turning: the machine is driven, with a lock. active: the drive starts, runs or stops. boot: the program has not
    looked at its parameters yet; only these are disturbed. names: faults that the drive has told by then.
    """

    name: str
    at_s: float
    turning: bool = True
    active: bool = True
    boot: bool = False
    names: frozenset[str] = frozenset()

    def takes(self, fault: Fault) -> bool:
        """Whether the fault can happen there."""
        return (self.turning or not fault.turning) and (self.active or not fault.active)


@dataclass(frozen=True)
class Drive:
    """A scenario and its moments.

    can: the chip has the CAN controller although the firmware has no node. pins: only pins, firmware, lines and bits
    are disturbed. board: the chip is on a board, whose clocks and lock are disturbed (`fluxverify.campaign.board`).
    """

    name: str
    scenario: str
    moments: tuple[Moment, ...]
    can: bool = False
    pins: bool = False
    board: bool = False

    def load(self) -> Scenario:
        """The scenario."""
        return load_scenario(ROOT / "scenarios" / self.scenario)


# In every state of the drive; no line of the scenario comes within a run.
ON_A_BOARD = (
    Moment("ready", 0.0035, turning=False, active=False),
    Moment("starting", 0.012, turning=False),
    Moment("accelerating", 0.018),
    Moment("running", 0.031),
    Moment("stopping", 0.0395),
    Moment("fault", 0.051, turning=False, active=False, names=PIN),
)

DRIVES = (
    Drive(
        "six-step",
        "campaign/six-step.toml",
        (
            Moment("ready", 0.0035, turning=False, active=False),
            Moment("catching", 0.006, turning=False),
            Moment("accelerating", 0.020),
            Moment("steady", 0.065),
            Moment("loaded", 0.085),
        ),
    ),
    Drive("start", "demo.toml", (Moment("align", 0.060, turning=False), Moment("ramp", 0.200, turning=False))),
    Drive(
        "vector",
        "campaign/vector.toml",
        (Moment("accelerating", 0.030), Moment("steady", 0.080), Moment("loaded", 0.110)),
    ),
    Drive(
        "five-phase",
        "campaign/five-phase.toml",
        (Moment("search", 0.020, turning=False), Moment("steady", 0.27), Moment("reversing", 0.605)),
        can=True,
    ),
    Drive("hall", "six-step/hall.toml", (Moment("ramp", 0.080), Moment("steady", 0.200)), pins=True),
    Drive("encoder", "vector/encoder.toml", (Moment("steady", 0.250), Moment("reversing", 0.410)), pins=True),
    Drive("can", "campaign/can.toml", (Moment("accelerating", 0.045), Moment("steady", 0.080)), pins=True),
    Drive("board", "campaign/board.toml", ON_A_BOARD, board=True),
    Drive("board-vector", "campaign/board-vector.toml", ON_A_BOARD, board=True),
    Drive("boot", "campaign/six-step.toml", (Moment("reset", 1e-6, turning=False, active=False, boot=True),)),
)
