# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0

"""A scenario carried out on a native drive: its events in order, its ramps, what the console answers."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from fluxlock.base.stage import SIMULATING, Progress, ProgressInfo
from fluxlock.clock import CLOCK_HZ
from fluxlock.config import Problem, Scenario
from fluxlock.config.motor import RPM_PER_RAD_S
from fluxlock.config.scenario import NOISY_LSB, Event, Fault, Mechanics
from fluxlock.cosim.console import NO_REPLY
from fluxlock.firmware.host import HostFirmware
from fluxlock.python_load import PythonLoad
from fluxlock.results.rundata import TRIP_CAUSES, RecordArray, Rejection, RunData

FINAL_COMMANDS = ("status", "faults", "stats")


# Of the gate driver, in the trip register, and where that has what is present.
PIN, NOW = 1 << TRIP_CAUSES.index("fault_pin"), 8

# Of the link: with less the models, which divide by it, have no number.
LEAST_LINK_V = 1e-3

TELL_S = 0.1  # of progress, wall clock

# Faults of the plant that the machines know: `open_phase` of one phase, `stuck_rotor` of a free one.
FAULTS = ("open_phase", "fault_pin", "stuck_rotor", "noisy_channels", "clear")
PHASES = "ABC"


def not_played(fault: Fault, mechanics: Mechanics) -> str | bool:
    """Why a native drive has not this fault; False: it has."""
    if fault.kind not in FAULTS:
        return f"the native program has no {fault.kind}, it has: {', '.join(FAULTS)}"
    if len(fault.phases or ()) > 1 or not set(fault.phases or ()) <= set(PHASES):
        return f"the native program opens one phase of {', '.join(PHASES)}"
    if fault.kind == "stuck_rotor" and mechanics.mode != "free":
        return f"the rotor is not free: mechanics.mode is {mechanics.mode}"
    return False


def common_refusals(scenario: Scenario) -> dict[str, str | bool]:
    """What no native drive is, a text by key; False: the scenario does not ask for it."""
    motor, inverter = scenario.motor, scenario.inverter
    return {
        "motor.phases": motor.phases != 3 and "the native program has three phases",
        "motor.saturation": motor.saturation is not None and "the native program's machine does not saturate",
        "inverter.supply_diode": inverter.supply_diode and "the native program's supply takes energy back",
        "inverter.brake_chopper": inverter.brake_chopper is not None and "the native program has no brake chopper",
        "inverter.protection.safe_state": inverter.protection.safe_state != "off"
        and "the native program's trip opens all gates",
        "inverter.sensing": bool(inverter.sensing.sources) and "the native program's sensors are wired right",
        "can": scenario.can is not None and "a scenario that is played has no bus; leave [can] out",
        **{
            f"event[{k}].fault": not_played(event.fault, scenario.mechanics)
            for k, event in enumerate(scenario.event)
            if event.fault is not None
        },
    }


def problems_of(scenario: Scenario, found: dict[str, str | bool]) -> list[Problem]:
    """The texts as problems of the scenario's files."""
    return [scenario.sources.problem(key, text) for key, text in found.items() if isinstance(text, str)]


@dataclass(frozen=True)
class Taken:
    """Rows of a stretch of a run. more: name -> a value per record."""

    records: RecordArray
    log: NDArray[np.int64]  # rows as LogKind says
    more: dict[str, NDArray[np.float64]]
    trips: int  # causes, bits in the order of TRIP_CAUSES


@dataclass
class Ramp:
    """A value on its way, linear in time."""

    begin_s: float
    length_s: float
    begin: float
    end: float
    put: Callable[[float], None]

    def follow(self, now_s: float) -> bool:
        """Set the value of now; whether the ramp goes on."""
        share = min(1.0, (now_s - self.begin_s) / self.length_s) if self.length_s > 0.0 else 1.0
        self.put(self.begin + share * (self.end - self.begin))
        return share < 1.0


class NativeChip(Protocol):
    """What plays a chip of any method."""

    @property
    def fw(self) -> HostFirmware:
        """The drive's program."""

    @property
    def now(self) -> float:
        """Simulated time, s."""

    def get(self, name: str) -> int:
        """Value of a register."""

    def put(self, name: str, value: int) -> None:
        """Set a register."""

    def trip(self, causes: int) -> None:
        """Latch trip causes and open the gates."""


class ScenarioPlay(ABC):
    """One run of a scenario on a native drive."""

    chip: NativeChip

    def __init__(self, scenario: Scenario, seed: int) -> None:
        self.scenario, self.seed = scenario, seed
        self.uart: list[str] = []
        self.rejected: list[Rejection] = []
        self.ramps: list[Ramp] = []
        self.load_factor = 1.0
        self.load: PythonLoad | None = None
        self.held_nm = 0.0  # its torque
        self.progress: Progress | None = None
        self._begin_s = self._told_s = 0.0  # wall clock at the begin, and when `progress` was told last
        self.supply_v = scenario.inverter.supply_v

    @property
    def firmware(self) -> HostFirmware:
        """The drive's program."""
        return self.chip.fw

    @property
    def now(self) -> float:
        """Simulated time, s."""
        return self.chip.now

    @property
    @abstractmethod
    def shaft(self) -> tuple[float, float]:
        """Mechanical speed, rad/s, and angle, rad, unwrapped."""

    @abstractmethod
    def set_load(self, factor: float) -> None:
        """Scale the scenario's load; `held_nm` comes on top."""

    @abstractmethod
    def set_supply(self, volt: float) -> None:
        """Change the supply."""

    @abstractmethod
    def open_phase(self, phase: int | None) -> None:
        """A leg, 0 to 2, loses the machine; None: no one has."""

    def set_pin(self, on: bool) -> None:
        """Level of the gate driver's fault output."""
        if on:
            self.chip.trip(PIN)
            self.chip.put("safety.trip", self.chip.get("safety.trip") | PIN << NOW)
        else:
            self.chip.put("safety.trip", self.chip.get("safety.trip") & ~(PIN << NOW))

    @abstractmethod
    def set_locked(self, on: bool) -> None:
        """The rotor, a free one, stands at once and stays, or turns again."""

    @abstractmethod
    def set_noise(self, lsb: float | None) -> None:
        """Noise of the converter's codes, rms; None: as it was at the begin."""

    @abstractmethod
    def take(self) -> Taken:
        """What was recorded since the last call, which is then forgotten."""

    @abstractmethod
    def advance(self, until_s: float) -> None:
        """Run, and let ramps follow."""

    @abstractmethod
    def data(self, wall_s: float) -> RunData:
        """What was recorded."""

    def agenda(self) -> Iterator[tuple[float, Callable[[], None]]]:
        """Actions and their times, in any order."""
        for event in self.scenario.event:
            yield event.at_s, partial(self.act, event)

    def command(self, line: str) -> None:
        """A line for the console."""
        replies = self.firmware.command(line)
        self.uart += replies
        answer = replies[-1] if replies else NO_REPLY
        if answer != "ok":
            self.rejected.append(Rejection(self.now, line, answer.removeprefix("error: ")))

    def _keep_load(self, factor: float) -> None:
        self.load_factor = factor
        self.set_load(factor)

    def _keep_supply(self, volt: float) -> None:
        self.supply_v = volt
        self.set_supply(volt)

    def act(self, event: Event) -> None:
        """Carry out an event."""
        if event.load_factor is not None:
            self.ramps.append(Ramp(self.now, event.ramp_s, self.load_factor, event.load_factor, self._keep_load))
        elif event.supply_v is not None:
            self.ramps.append(Ramp(self.now, event.ramp_s, self.supply_v, event.supply_v, self._keep_supply))
        elif event.fault is not None:
            self.inject(event.fault)
        elif event.speed_rpm is not None:
            self.command(f"set speed_rpm {round(event.speed_rpm)}")
        elif event.accel_rpm_per_s is not None:
            self.command(f"set accel_rpm_s {round(event.accel_rpm_per_s)}")
        else:
            assert event.command is not None
            self.command(event.command)

    def inject(self, fault: Fault) -> None:
        """Begin a fault of the plant, or end all."""
        if fault.kind == "open_phase":
            self.open_phase(PHASES.index((fault.phases or ["A"])[0]))
        elif fault.kind == "fault_pin":
            self.set_pin(True)
        elif fault.kind == "stuck_rotor":
            self.set_locked(True)
        elif fault.kind == "noisy_channels":
            self.set_noise(NOISY_LSB if fault.noise_lsb is None else fault.noise_lsb)
        else:
            self.open_phase(None)
            self.set_pin(False)
            self.set_noise(None)
            if self.scenario.mechanics.mode == "free":
                self.set_locked(False)

    def follow(self, tick_s: float) -> None:
        """Set the values of now of everything on its way, and for a tick the load that is written in Python."""
        self.ramps = [ramp for ramp in self.ramps if ramp.follow(self.now)]
        if self.load is not None:
            self.held_nm = self.load.torque_nm(self.now, *self.shaft, tick_s)
            self.set_load(self.load_factor)
        # The first step of a first run compiles its models: until its end the twin is building.
        if self.progress is not None and self.now > 0.0 and time.perf_counter() - self._told_s > TELL_S:
            self._tell(self.progress)

    def _tell(self, progress: Progress) -> None:
        self._told_s = time.perf_counter()
        rate_hz = self.now * CLOCK_HZ / (self._told_s - self._begin_s)
        speed_rpm = self.shaft[0] * RPM_PER_RAD_S
        progress(ProgressInfo(self.now, self.scenario.duration_s, speed_rpm, rate_hz, SIMULATING))

    def run(self, load: PythonLoad | None = None, progress: Progress | None = None) -> RunData:
        """The scenario from its begin to its end; load: on top of the scenario's. progress: is told how far it is."""
        self.load, self.progress = load, progress
        self._begin_s = time.perf_counter()
        for at_s, act in sorted(self.agenda(), key=lambda entry: entry[0]):
            self.advance(min(self.scenario.duration_s, at_s))
            act()
        self.advance(self.scenario.duration_s)
        for line in FINAL_COMMANDS:
            self.uart += self.firmware.command(line)
        if progress is not None:
            self._tell(progress)
        return self.data(time.perf_counter() - self._begin_s)
